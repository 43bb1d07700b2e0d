#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# One line from nothing to the running framework: builds the image if it is not there, makes the container with the
# screen (and the GPU, if asked) of this computer, and starts the framework in it.
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
IMAGE=${MBF_IMAGE:-modular_framework}

usage() {
  cat <<'TEXT'
usage: docker/deploy.sh container_name=NAME nvidia=true|false [ARG:=VALUE..]

  container_name   name of the container to make; an existing one of this name is started again
  nvidia           true: hand the Nvidia GPU to the container (needs the Nvidia container toolkit)
  ARG:=VALUE       arguments of start_framework.launch
TEXT
}

fail() {  # message, what to do
  printf 'error: %s\n  what to do: %s\n' "$1" "$2" >&2
  exit 1
}

container_name="" nvidia=""
launch_arguments=()
for argument in "$@"; do
  case $argument in
    container_name=*) container_name=${argument#*=} ;;
    nvidia=*) nvidia=${argument#*=} ;;
    *:=*) launch_arguments+=("$argument") ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; fail "unknown argument '$argument'" "give container_name=NAME and nvidia=true or nvidia=false" ;;
  esac
done

[[ $container_name =~ ^[a-zA-Z0-9][a-zA-Z0-9_.-]*$ ]] ||
  fail "container_name is '$container_name'" "give letters, digits, '_', '.' and '-', e.g. container_name=mbf"
case $nvidia in
  true | false) ;;
  *) fail "nvidia is '$nvidia'; allowed: true, false" "give nvidia=false unless the Nvidia drivers are in use" ;;
esac
command -v docker >/dev/null || fail "docker is missing" "install Docker Engine (package docker.io on Debian and Ubuntu)"
docker info >/dev/null 2>&1 || fail "the Docker engine does not answer" "start it, or add this user to the group docker"

if docker container inspect "$container_name" >/dev/null 2>&1; then
  [ ${#launch_arguments[@]} = 0 ] ||
    fail "container '$container_name' exists already with arguments of its own" \
      "leave the launch arguments out, choose another name, or remove it: docker rm $container_name"
  echo "Starting the existing container '$container_name'"
  exec docker start --attach "$container_name"
fi

if ! docker image inspect "$IMAGE" >/dev/null 2>&1; then
  echo "Building the image '$IMAGE' (some minutes)"
  docker build --build-arg "USER_ID=$(id -u | sed 's/^0$/1000/')" -f "$ROOT/docker/Dockerfile" -t "$IMAGE" "$ROOT"
fi

options=(--name "$container_name" --init)
if [ -n "${DISPLAY:-}" ]; then
  options+=(--env "DISPLAY=$DISPLAY" --env QT_X11_NO_MITSHM=1 --volume /tmp/.X11-unix:/tmp/.X11-unix:rw --ipc host)
  if [ -n "${XAUTHORITY:-}" ] && [ -f "$XAUTHORITY" ]; then
    options+=(--env XAUTHORITY=/home/user/.Xauthority --volume "$XAUTHORITY:/home/user/.Xauthority:ro")
  fi
fi
if [ "$nvidia" = true ]; then
  options+=(--gpus all --env NVIDIA_DRIVER_CAPABILITIES=all)
elif [ -d /dev/dri ]; then
  options+=(--device /dev/dri)
fi

echo "Making and starting the container '$container_name'"
exec docker run "${options[@]}" "$IMAGE" run ${launch_arguments[@]+"${launch_arguments[@]}"}
