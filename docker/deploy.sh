#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# One line from nothing to the running framework: installs Docker Engine if that is wanted, builds or pulls the image,
# makes the container with what it may use of this computer, and starts the framework in it. See usage below.
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
LAUNCH_FILE=src/modular_framework_api/launch/start_framework.launch
ARGUMENTS_FILE=/home/user/.launch_arguments # read by docker/entrypoint
OPTIONS="container_name nvidia image workspace device usb real_time headless reinstall install_engine"
KEPT_OPTIONS="nvidia image workspace device usb real_time headless" # of a container as long as it lives
GRAPHICS_DEVICE=${GRAPHICS_DEVICE:-/dev/dri}
LATENCY_DEVICE=${LATENCY_DEVICE:-/dev/cpu_dma_latency}
NVIDIA_DRIVER=${NVIDIA_DRIVER:-/proc/driver/nvidia/version}
WSL_DRIVER=${WSL_DRIVER:-/usr/lib/wsl/lib/nvidia-smi}
USB_FOLDER=${USB_FOLDER:-/dev/bus/usb}
USER_ID=${SUDO_UID:-$(id -u)} # whom the files in a workspace belong to
[ "$USER_ID" != 0 ] || USER_ID=1000

usage() {
  cat <<'TEXT'
usage: docker/deploy.sh container_name=NAME nvidia=true|false [OPTION=VALUE..] [ARG:=VALUE..]

Makes the container NAME and starts the framework in it; one that exists is started again.

  container_name=NAME        letters, digits, '_', '.' and '-'
  nvidia=true|false          hand the Nvidia GPU to the container (needs the Nvidia container toolkit)
  image=NAME[:TAG]           use this image, pulled if it is not here; without it modular_framework is built and used
  workspace=FOLDER           folder with your config/, tasks/, states/ and src/ (methods, robots); records and results are
                             written to results/ in it
  device=PATH                hand a device to the container, such as /dev/ttyUSB0; may be given more than once
  usb=true|false             hand over all USB devices, also those plugged in later (default: false)
  real_time=true|false       allow real-time priority and locked memory, for hardware (default: false)
  headless=true|false        true: no window, end with the task (default: false if there is a display)
  reinstall=true|false       build (or pull) the image again and replace the container; what was written in the old
                             one, and not in a workspace, is lost (default: false)
  install_engine=ask|yes|no  install Docker Engine where it is missing (default: ask, which is no without a terminal)
  ARG:=VALUE                 arguments of start_framework.launch. A container keeps them; for one that exists, new ones
                             take the place of all of them
  -h, --help                 show this text
TEXT
}

fail() {  # message, what to do
  printf 'error: %s\n  what to do: %s\n' "$1" "$2" >&2
  exit 1
}

# ---- arguments

# Prints the word of standard input (one a line) that takes the fewest changed, added or missing letters.
nearest() {  # word
  WORD=$1 awk '
    function distance(a, b,    i, j, d, best) {
      for (j = 0; j <= length(b); j++) d[0, j] = j
      for (i = 1; i <= length(a); i++) {
        d[i, 0] = i
        for (j = 1; j <= length(b); j++) {
          best = d[i - 1, j - 1] + (substr(a, i, 1) != substr(b, j, 1))
          if (d[i - 1, j] + 1 < best) best = d[i - 1, j] + 1
          if (d[i, j - 1] + 1 < best) best = d[i, j - 1] + 1
          d[i, j] = best
        }
      }
      return d[length(a), length(b)]
    }
    { found = distance(ENVIRON["WORD"], $0); if (NR == 1 || found < least) { least = found; answer = $0 } }
    END { print answer }'
}

is_given() { case " $given " in *" $1 "*) return 0 ;; *) return 1 ;; esac; }

read_arguments() {
  container_name="" nvidia="" image="" workspace="" usb=false real_time=false headless="" reinstall=false
  install_engine=ask device="" given="" launch_arguments=()
  local argument
  for argument in "$@"; do
    case $argument in
      -h | --help) usage; exit 0 ;;
      [a-zA-Z_]*:=*) launch_arguments+=("$argument") ;;
      *=*) read_option "${argument%%=*}" "${argument#*=}" ;;
      *) fail "unknown argument '$argument'" "give OPTION=VALUE or ARG:=VALUE; docker/deploy.sh --help lists them" ;;
    esac
  done
}

launch_argument_names() { sed -n 's/^  <arg name="\([a-z_]*\)".*/\1/p' "$ROOT/$LAUNCH_FILE"; }

read_option() {  # name, value
  case " $OPTIONS " in
    *" $1 "*) ;;
    *)
      ! launch_argument_names | grep -qxF "$1" ||
        fail "'$1' is an argument of start_framework.launch, and these are given with ':='" "give $1:=$2"
      fail "unknown option '$1'; allowed: ${OPTIONS// /, }" "did you mean '$(tr ' ' '\n' <<<"$OPTIONS" | nearest "$1")'?"
      ;;
  esac
  if [ "$1" = device ]; then
    check_device "$2"
    device="${device:+$device }$2"
  else
    if is_given "$1"; then fail "$1 is given twice" "give it once"; fi
    printf -v "$1" '%s' "$2"
  fi
  given="$given $1"
}

check_device() {  # path
  [[ $1 =~ ^/dev/[^[:space:]:]+$ ]] || fail "device is '$1'; allowed: a path in /dev" "e.g. device=/dev/ttyUSB0"
  [ -c "$1" ] || fail "there is no device '$1'; serial devices here: $(serial_devices)" \
    "plug it in, or give another one (those in /dev/serial/by-id keep their names)"
}

serial_devices() {
  local path found=""
  for path in /dev/ttyUSB* /dev/ttyACM* /dev/serial/by-id/*; do
    [ ! -c "$path" ] || found="$found $path"
  done
  printf '%s' "${found:- none}" | cut -c 2-
}

check_choice() {  # option, its value, allowed values...
  local option=$1 value=$2
  shift 2
  case " $* " in *" $value "*) return ;; esac
  local allowed=$*
  fail "$option is '$value'; allowed: ${allowed// /, }" "give $option=$(printf '%s\n' "$@" | nearest "$value")"
}

check_values() {
  local name
  for name in container_name nvidia; do
    is_given "$name" || fail "$name= is missing" \
      "give both that are always needed, such as: docker/deploy.sh container_name=mbf nvidia=false ('--help' lists all options)"
  done
  [[ $container_name =~ ^[a-zA-Z0-9][a-zA-Z0-9_.-]*$ ]] ||
    fail "container_name is '$container_name'; allowed: letters, digits, '_', '.' and '-'" "e.g. container_name=mbf"
  case $nvidia in
    true | false) ;;
    *) fail "nvidia is '$nvidia'; allowed: true, false" "give nvidia=false unless the Nvidia drivers are in use" ;;
  esac
  for name in usb real_time reinstall; do check_choice "$name" "${!name}" true false; done
  check_choice install_engine "$install_engine" ask yes no
  if is_given headless; then check_choice headless "$headless" true false; fi
  [ "$headless" != false ] || [ -n "${DISPLAY:-}" ] ||
    fail "headless is false, but there is no display" "log in with a screen, set DISPLAY, or give headless=true"
  ! is_given image || [[ $image =~ ^[a-z0-9][a-zA-Z0-9_./:@-]*$ ]] ||
    fail "image is '$image'; allowed: NAME or NAME:TAG, in small letters" "e.g. image=modular_framework:latest"
  [ "$usb" = false ] || [ -d "$USB_FOLDER" ] ||
    fail "usb is true, but this computer has no $USB_FOLDER" "give the devices one by one: device=PATH"
  if is_given workspace; then check_workspace; fi
  is_given image || check_launch_arguments
}

check_workspace() {
  [[ $workspace != \~/* ]] || workspace="$HOME/${workspace:2}" # some shells leave it to the program
  [ -d "$workspace" ] || fail "workspace '$workspace' is not a folder" "make it: mkdir -p '$workspace'"
  workspace=$(cd "$workspace" && pwd -P)
  case $workspace in *:*) fail "workspace '$workspace' has a ':' in its path" "give a folder without one" ;; esac
  [ -n "$(find "$workspace" -maxdepth 0 -user "$USER_ID")" ] ||
    fail "workspace '$workspace' does not belong to user $USER_ID, as whom the container writes to it" \
      "run this as its owner, or: sudo chown -R $USER_ID '$workspace'"
}

# Of this checkout's launch file; an image from elsewhere checks its own.
check_launch_arguments() {
  local argument name names
  names=$(launch_argument_names)
  for argument in ${launch_arguments[@]+"${launch_arguments[@]}"}; do
    name=${argument%%:=*}
    grep -qxF "$name" <<<"$names" ||
      fail "start_framework.launch has no argument '$name'" "did you mean '$(nearest "$name" <<<"$names")'? all are in $LAUNCH_FILE"
  done
}

# ---- engine

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

may_install_engine() {
  local answer=""
  case $install_engine in yes) return 0 ;; no) return 1 ;; esac
  [ -t 0 ] || return 1
  echo "Docker Engine is missing. This can install Debian's or Ubuntu's package docker.io and add '$1' to the group docker,"
  echo "whose members have all rights on this computer."
  read -r -p "Install it now? [y/N] " answer
  [[ $answer == [yY] || $answer == [yY][eE][sS] ]]
}

install_docker() {  # arguments of this script...
  local user=${SUDO_USER:-$(id -un)}
  command -v apt-get >/dev/null ||
    fail "docker is missing, and this script installs it on Debian and Ubuntu only" "install Docker Engine as its manual says"
  may_install_engine "$user" ||
    fail "docker is missing" "install Docker Engine (package docker.io on Debian and Ubuntu), or give install_engine=yes"
  as_root apt-get update
  as_root apt-get install -y docker.io
  command -v docker >/dev/null || fail "docker is still missing after its installation" "read the messages of apt-get above"
  [ "$user" = root ] || as_root usermod -aG docker "$user"
  # this login is not in the group yet: go on in a shell that is
  docker info >/dev/null 2>&1 || ! command -v sg >/dev/null || exec sg docker -c "$(printf '%q ' "$0" "$@")"
}

check_engine() {  # arguments of this script...
  command -v docker >/dev/null || install_docker "$@"
  docker info >/dev/null 2>&1 || fail "the Docker engine does not answer" \
    "start it (sudo systemctl start docker; where there is only its client: sudo apt-get install docker.io), or add this \
user to the group docker (sudo usermod -aG docker $(id -un)) and log in again"
}

check_nvidia_driver() {
  [ "$nvidia" = true ] || return 0
  [ -e "$NVIDIA_DRIVER" ] || [ -e "$WSL_DRIVER" ] ||
    fail "nvidia is true, but no Nvidia driver is loaded on this computer (no $NVIDIA_DRIVER)" \
      "install the driver of the graphics card (with WSL 2: in Windows), or give nvidia=false"
}

# Starts a container of an empty image with the GPU. The engine refuses it without the container toolkit and with one that
# it does not use, which neither the programs that are installed nor its list of runtimes tell.
check_engine_hands_over_gpu() {
  local probe answer
  [ "$nvidia" = true ] || return 0
  probe=$(tar -c --files-from /dev/null | docker import - 2>/dev/null) || return 0
  answer=$(docker run --rm --gpus all "$probe" /none 2>&1) || true # there is no program to run
  docker image rm "$probe" >/dev/null 2>&1 || true
  case $answer in
    *"could not select device driver"*)
      fail "nvidia is true, but Docker cannot hand over a GPU: its Nvidia container toolkit is missing or not in use" \
        "install the package nvidia-container-toolkit as its manual says, run 'sudo nvidia-ctk runtime configure \
--runtime=docker && sudo systemctl restart docker', or give nvidia=false"
      ;;
  esac
}

# ---- image

image_id() { docker image inspect --format '{{.Id}}' "$image" 2>/dev/null || true; }

prepare_image() {
  if [ "$reinstall" = false ] && [ -n "$(image_id)" ]; then return; fi
  if is_given image; then
    docker pull "$image" || fail "the image '$image' is not here and cannot be pulled" "check its name, or leave image= out to build it"
  else
    echo "Building the image '$image' (some minutes)"
    docker build --build-arg "USER_ID=$USER_ID" -f "$ROOT/docker/Dockerfile" -t "$image" "$ROOT" ||
      fail "the image could not be built" "read the messages above"
  fi
}

# Removes the image that another one has taken the name of, unless it has other names or a container uses it.
remove_old_image() {  # its id
  if [ -n "$1" ] && docker image ls --quiet --no-trunc --filter dangling=true | grep -qxF "$1"; then
    docker image rm "$1" >/dev/null 2>&1 || true
  fi
}

# Files in the workspace belong to the image's user, who has the number it was built with.
check_user_of_image() {
  local user
  user=$(docker image inspect --format '{{index .Config.Labels "modular_framework.user_id"}}' "$image" 2>/dev/null || true)
  [ "$user" = "$USER_ID" ] || fail "the image '$image' writes as user '$user', the workspace belongs to user $USER_ID" \
    "build an image for this user: leave image= out and give reinstall=true"
}

# ---- container

container_exists() { docker container inspect "$container_name" >/dev/null 2>&1; }

option_of_container() {  # option
  docker container inspect --format "{{index .Config.Labels \"modular_framework.$1\"}}" "$container_name" 2>/dev/null || true
}

check_made_here() {
  [ -n "$(option_of_container image)" ] ||
    fail "there is a container '$container_name' that this script did not make" "choose another container_name"
}

check_not_running() {  # what is asked for
  [ "$(docker container inspect --format '{{.State.Running}}' "$container_name")" != true ] ||
    fail "container '$container_name' is running: $1" "stop it first: docker stop $container_name"
}

add_device() {  # path; with the groups that may use it
  local path group
  options+=(--device "$1")
  for path in "$1" "$1"/*; do
    [ -c "$path" ] || continue
    group=$(stat -L -c %g "$path")
    case "--group-add 0 ${options[*]} " in *"--group-add $group "*) ;; *) options+=(--group-add "$group") ;; esac
  done
}

add_screen() {
  options+=(--hostname "$(uname -n)" --env "DISPLAY=$DISPLAY" --env QT_X11_NO_MITSHM=1) # the key is for this host name
  options+=(--volume /tmp/.X11-unix:/tmp/.X11-unix:rw --ipc host)
  [ -n "${XAUTHORITY:-}" ] && [ -f "$XAUTHORITY" ] || return 0
  options+=(--env XAUTHORITY=/home/user/.Xauthority --volume "$(copy_screen_key):/home/user/.Xauthority:ro")
}

# Copies the screen's key and prints where to: its own path may be another one at the next login, a container's is not.
copy_screen_key() {
  local folder="${XDG_CACHE_HOME:-$HOME/.cache}/modular_framework"
  mkdir -p "$folder"
  (umask 077 && cat "$XAUTHORITY" >"$folder/screen_key")
  [ "$(id -u)" != 0 ] || chown "$USER_ID" "$folder/screen_key"
  printf '%s' "$folder/screen_key"
}

add_hardware() {
  local path
  for path in $device; do add_device "$path"; done
  [ "$usb" = false ] || options+=(--volume "$USB_FOLDER:/dev/bus/usb" --device-cgroup-rule 'c 189:* rmw')
  [ "$real_time" = true ] || return 0
  options+=(--cap-add SYS_NICE --ulimit rtprio=80 --ulimit memlock=-1)
  [ ! -e "$LATENCY_DEVICE" ] || options+=(--device "$LATENCY_DEVICE:/dev/cpu_dma_latency")
}

make_container() {
  local name
  options=(--name "$container_name" --init)
  for name in $KEPT_OPTIONS; do options+=(--label "modular_framework.$name=${!name}"); done
  [ "$headless" = true ] || add_screen
  if [ "$nvidia" = true ]; then
    options+=(--gpus all --env NVIDIA_DRIVER_CAPABILITIES=all)
  elif [ "$headless" = false ] && [ -e "$GRAPHICS_DEVICE" ]; then
    add_device "$GRAPHICS_DEVICE"
  fi
  [ -z "$workspace" ] || options+=(--volume "$workspace:/workspace")
  add_hardware
  echo "Making the container '$container_name'"
  docker create "${options[@]}" "$image" run >/dev/null
}

# Replaces the container by one of a new image; the old container and image go when the new ones are there.
replace_container() {
  local old
  old=$(image_id)
  if container_exists; then
    check_made_here
    check_not_running "it cannot be replaced"
  fi
  check_engine_hands_over_gpu
  prepare_image
  [ -z "$workspace" ] || check_user_of_image
  if container_exists; then docker rm "$container_name" >/dev/null; fi
  make_container
  remove_old_image "$old"
}

# Devices, folders and the like cannot be changed in a container: asking for other ones is an error.
check_same_options() {
  local name made
  check_made_here
  for name in $KEPT_OPTIONS; do
    is_given "$name" || continue
    made=$(option_of_container "$name")
    [ "$made" = "${!name}" ] || fail "container '$container_name' exists already, with $name='$made'" \
      "start it with what it has, choose another container_name, or replace it with reinstall=true"
  done
}

set_launch_arguments() {
  local file
  [ ${#launch_arguments[@]} != 0 ] || return 0
  check_not_running "its launch arguments cannot be changed"
  file=$(mktemp)
  printf '%s\0' "${launch_arguments[@]}" >"$file"
  chmod 644 "$file"
  docker cp "$file" "$container_name:$ARGUMENTS_FILE"
  rm "$file"
}

main() {
  read_arguments "$@"
  check_values
  check_nvidia_driver
  check_engine "$@"
  if [ "$reinstall" = false ] && container_exists; then
    check_same_options
    [ -z "${XAUTHORITY:-}" ] || [ ! -f "$XAUTHORITY" ] || copy_screen_key >/dev/null
  else
    [ -n "$image" ] || image=modular_framework
    [ -n "$headless" ] || headless=$([ -n "${DISPLAY:-}" ] && echo false || echo true)
    replace_container
  fi
  set_launch_arguments
  echo "Starting the container '$container_name'"
  exec docker start --attach "$container_name"
}

main "$@"
