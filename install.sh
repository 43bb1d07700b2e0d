#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets the framework up on Debian 12 and runs it. See usage below.
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
VENV="$ROOT/.venv"
LOG="$ROOT/logs/install.log"
STAMPS="$ROOT/.venv/.stamps"
SITE_BUILDER="$ROOT/.venv/site_builder"
PROGRESS_PERIOD_S=${PROGRESS_PERIOD_S:-30}

usage() {
  cat <<'TEXT'
usage: ./install.sh [COMMAND]

  (none)               set the framework up: Debian packages, Python environment, build
  run [ARG:=VALUE..]   set up, then run the simulated pick; arguments are those of start_framework.launch
  experiment FILE      set up, then run an experiment and write its report; options are those of run_experiment
  test [--repeat N] [SUITE]  set up, then run the tests: all (the default), full (with further robots and scenarios),
                       lint, unit, rostest, system or one suite
  shell                set up, then open a shell with everything sourced
  doctor [ARG:=VALUE..]  check installation, configuration and running nodes; --report FILE writes what an issue needs
  exec COMMAND..       set up, then run a command with everything sourced, e.g. a benchmark
  site                 set up, then build the documentation as a web site, which any browser opens from the disk
  wheel [FOLDER]       build the wheel of statistics and reports, which needs no ROS, into FOLDER (default: build_wheel)
  packages             only install the Debian packages and the Python environment
  help                 show this text

Set-up may be repeated: what is done already is not done again.
INSTALL_SPACE=1 builds and uses an install space instead of the devel space.
TEXT
}

say() { printf '%s\n' "$*"; }

fail() {  # message, what to do
  printf '\nerror: %s\n' "$1" >&2
  [ $# -lt 2 ] || printf '  what to do: %s\n' "$2" >&2
  exit 1
}

# Shows that a step is running: on a terminal its seconds and the last line of the log, elsewhere its seconds now and then.
show_progress() {  # title
  local start=$SECONDS shown=$SECONDS line
  while sleep 1 >/dev/null && kill -0 "$$" 2>/dev/null; do
    if [ -t 1 ]; then
      line="$1 ... $((SECONDS - start)) s  $(tail -n 1 "$LOG" | tr -cd '[:print:]')"
      printf '\r%s\033[K' "${line:0:$(($(tput cols 2>/dev/null || echo 80) - 1))}"
    elif [ $((SECONDS - shown)) -ge "$PROGRESS_PERIOD_S" ]; then
      shown=$SECONDS
      printf '%d s ... ' $((SECONDS - start))
    fi
  done
}

# Runs a step with its output in the log; on failure shows the end of the log and what to do.
step() {  # title, what to do on failure, command...
  local title=$1 remedy=$2 start=$SECONDS code=0 progress clear=""
  shift 2
  printf '%s ... ' "$title"
  printf '\n==== %s\n' "$title" >>"$LOG"
  show_progress "$title" &
  progress=$!
  "$@" >>"$LOG" 2>&1 || code=$?
  kill "$progress" 2>/dev/null || true
  wait "$progress" 2>/dev/null || true
  [ ! -t 1 ] || clear=$(printf '\r\033[K%s ... ' "$title")
  if [ "$code" = 0 ]; then
    printf '%sdone (%d s)\n' "$clear" $((SECONDS - start))
  else
    printf '%sFAILED\n' "$clear"
    tail -n 25 "$LOG" >&2
    fail "$title failed; the whole output is in $LOG" "$remedy"
  fi
}

check_path() {
  case $ROOT in
    *[[:space:]:\;\$\&#\"\'\`\\\(\)]*)
      fail "the checkout is in '$ROOT'; catkin and make cannot build in a path with a space or one of : ; \$ & # \" ' \` \\ ( )" \
        "move it to a path of letters, digits, '/', '_', '-' and '.', then run this script again"
      ;;
  esac
}

check_system() {
  local id="" version="" release=${OS_RELEASE_FILE:-/etc/os-release}
  if [ -r "$release" ]; then
    id=$(sed -n 's/^ID=//p' "$release" | tr -d '"')
    version=$(sed -n 's/^VERSION_ID=//p' "$release" | tr -d '"')
  fi
  if [ "$id" != debian ] || [ "$version" != 12 ]; then
    fail "this script sets up Debian 12 only; this system is '${id:-unknown} ${version:-}'" \
      "use Docker on any other system: docker/deploy.sh container_name=mbf nvidia=false"
  fi
  command -v apt-get >/dev/null || fail "apt-get is missing" "use a complete Debian 12"
}

as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  else
    sudo -n "$@"
  fi
}

# Asks for the password of sudo before a progress line can hide the prompt. Without root rights, ends with the command
# that an administrator has to run.
get_root_rights() {  # purpose, command for an administrator
  local reason="" remedy="ask an administrator to run, as root:

    $2

  then run this script again; it goes on from there"
  if [ "$(id -u)" = 0 ]; then
    return
  elif ! command -v sudo >/dev/null; then
    reason="sudo is missing"
  elif sudo -n true 2>/dev/null; then
    return
  elif ! { : </dev/tty; } 2>/dev/null; then
    reason="sudo asks for a password, and there is no terminal to ask on"
  else
    say "$1 needs root rights. sudo asks for your password now, and not again."
    if ! sudo -v; then
      reason="sudo refused you"
    elif ! sudo -n true 2>/dev/null; then
      reason="sudo asks for a password each time"
    fi
  fi
  [ -z "$reason" ] || fail "$1 needs root rights, and $reason" "$remedy"
}

# Prints the first file or folder of another user, below these, that this user may not write to.
first_locked() {  # path...
  find "$@" ! -user "$(id -u)" ! -writable ! -type l -print -quit 2>/dev/null || true
}

# An earlier run as root leaves files behind that this user may not write to.
check_owner() {
  local path owner name
  path=$(first_locked "$ROOT/logs")
  if [ -n "$path" ]; then
    owner=$(stat -c %U "$path")
    name="logs_of_${owner}_$(date +%s)"
    mv "$ROOT/logs" "$ROOT/$name" || fail "you may not write to $ROOT/logs" "sudo chown -R $(id -un) $ROOT"
    say "You may not write to files of $owner in the folder logs. It is now $name, and new output goes into a new folder logs."
  fi
  path=$(first_locked "$ROOT" "$VENV" -maxdepth 0)
  [ -n "$path" ] || path=$(first_locked "$ROOT/build" "$ROOT/devel" "$ROOT"/.*_cache)
  [ -z "$path" ] ||
    fail "$path belongs to $(stat -c %U "$path"), and you may not write to it" "sudo chown -R $(id -un) $ROOT"
}

# A bare root (a chroot, say) may lack what every running system has and the build, roslaunch and shells need.
mount_what_a_bare_root_lacks() {
  if [ ! -e /proc/self/stat ]; then
    get_root_rights "Mounting /proc" "mount -t proc proc /proc"
    as_root mount -t proc proc /proc || fail "/proc is not mounted" "mount -t proc proc /proc"
  fi
  if [ ! -e /dev/pts/ptmx ]; then
    get_root_rights "Mounting /dev/pts" "mkdir -p /dev/pts && mount -t devpts devpts /dev/pts"
    as_root mkdir -p /dev/pts
    as_root mount -t devpts devpts /dev/pts || fail "there are no pseudo-terminals" "mount -t devpts devpts /dev/pts"
  fi
  if [ ! -e /dev/fd ]; then
    get_root_rights "Making /dev/fd" "ln -s /proc/self/fd /dev/fd"
    as_root ln -s /proc/self/fd /dev/fd
  fi
  if ! getent hosts localhost >/dev/null; then
    get_root_rights "Naming localhost in /etc/hosts" "echo 127.0.0.1 localhost >>/etc/hosts"
    printf '127.0.0.1\tlocalhost\n' | as_root tee -a /etc/hosts >/dev/null
  fi
}

missing_debian_packages() {
  local package
  while read -r package; do
    case $package in '' | '#'*) continue ;; esac
    dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | grep -q '^installed$' || printf '%s\n' "$package"
  done <"$ROOT/packages-debian.txt"
}

install_debian_packages() {
  local missing
  read -ra missing <<<"$(missing_debian_packages | tr '\n' ' ')"
  if [ ${#missing[@]} = 0 ]; then
    say "[1/3] Debian packages: all installed"
    return
  fi
  get_root_rights "Installing ${#missing[@]} Debian packages" \
    "apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
  step "[1/3] Debian packages: updating the package lists" "check the network and /etc/apt/sources.list" \
    as_root env DEBIAN_FRONTEND=noninteractive apt-get update
  step "[1/3] Debian packages: installing ${#missing[@]} (some minutes on a bare system)" \
    "read the messages above; 'apt-get -f install' repairs a broken package state" \
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
}

make_python_environment() {
  local digest
  digest=$(sha256sum "$ROOT/requirements.txt" | cut -d' ' -f1)
  if [ -f "$STAMPS/$digest" ]; then
    say "[2/3] Python environment: up to date"
    return
  fi
  step "[2/3] Python environment: making .venv" "remove the folder .venv, then run this script again" \
    /usr/bin/python3 -m venv --system-site-packages "$VENV"
  step "[2/3] Python environment: installing requirements.txt (some minutes)" \
    "check the network; then run this script again" \
    "$VENV/bin/pip" install --disable-pip-version-check --progress-bar off -r "$ROOT/requirements.txt"
  mkdir -p "$STAMPS"
  touch "$STAMPS/$digest"
}

# Installs the packages of the documentation site into a separate folder, so that the environment still matches requirements.txt.
install_site_builder() {
  local digest
  digest=$(sha256sum "$ROOT/requirements-site.txt" | cut -d' ' -f1)
  if [ -f "$SITE_BUILDER/.$digest" ]; then
    say "      Builder of the site: up to date"
    return
  fi
  rm -rf "$SITE_BUILDER"
  step "      Builder of the site: installing requirements-site.txt" "check the network; then run this script again" \
    "$VENV/bin/pip" install --disable-pip-version-check --progress-bar off --target "$SITE_BUILDER" -r "$ROOT/requirements-site.txt"
  touch "$SITE_BUILDER/.$digest"
}

# Where an underlay has message and tool packages of its own, ours are left out of the build.
leave_out_packages_of_underlay() {
  local folder name ignore
  for folder in "$ROOT"/src/interfaces/*/ "$ROOT"/src/compat/*/; do
    name=$(basename "$folder")
    ignore="${folder}CATKIN_IGNORE"
    if [ -n "${UNDERLAY:-}" ] && [ -d "$UNDERLAY/share/$name" ]; then
      touch "$ignore"
    else
      rm -f "$ignore"
    fi
  done
}

# Everything whose change asks for a new build: definitions, build files, and which executables and launch files there are.
# The '/' behind the folders of src follows one that is a link, such as a container's to the packages of its workspace.
build_fingerprint() {
  {
    find "$ROOT"/src/*/ "$ROOT/.catkin_tools/profiles/default/config.yaml" -type f \( -name CMakeLists.txt -o -name package.xml -o -name setup.py -o -name '*.msg' \
      -o -name '*.srv' -o -name '*.action' -o -name '*.in' -o -name CATKIN_IGNORE -o -name config.yaml \) -print0 |
      sort -z | xargs -0 sha256sum
    find "$ROOT"/src/*/ -type f -perm -u+x | sort
    if [ "${INSTALL_SPACE:-0}" = 1 ]; then
      find "$ROOT"/src/*/ -type f ! -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum
    fi
    printf '%s %s\n' "${UNDERLAY:-none}" "${INSTALL_SPACE:-0}"
  } | sha256sum | cut -d' ' -f1
}

# Prints the path of the file with the fingerprint of the last build.
build_stamp() {
  local folder=build
  [ "${INSTALL_SPACE:-0}" = 0 ] || folder=build_install
  printf '%s\n' "$ROOT/$folder/.fingerprint"
}

build_workspace() {
  local fingerprint stamp install=--no-install
  leave_out_packages_of_underlay
  fingerprint=$(build_fingerprint)
  stamp=$(build_stamp)
  [ "${INSTALL_SPACE:-0}" = 0 ] || install=--install
  if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$fingerprint" ]; then
    say "[3/3] Workspace: up to date"
    return
  fi
  step "[3/3] Workspace: building" "read the messages above; 'catkin clean -y' removes what an earlier build left" \
    run_catkin_build "$install"
  printf '%s\n' "$fingerprint" >"$stamp"
}

# Without an installation, names what is missing and ends; an outdated build is only named.
examine_build() {
  local missing
  missing=$(missing_debian_packages | tr '\n' ' ')
  [ -z "$missing" ] || fail "Debian packages are missing: $missing" "./install.sh"
  [ -x "$VENV/bin/python3" ] || fail "the Python environment is missing" "./install.sh"
  [ -f "$(build_stamp)" ] || fail "the workspace is not built" "./install.sh"
  if [ "$(cat "$(build_stamp)")" != "$(build_fingerprint)" ]; then
    say "The build is older than the files that it was made from. What to do: ./install.sh"
  fi
}

run_catkin_build() {  # --install or --no-install
  cd "$ROOT"
  export PATH="$VENV/bin:$PATH" ROS_LANG_DISABLE=genlisp
  # shellcheck disable=SC1091
  [ -z "${UNDERLAY:-}" ] || . "$UNDERLAY/setup.sh"
  # the profile is committed without an install space: a copy that has one is made beside it and not committed
  local profile=default space=devel
  if [ "$1" = --install ]; then
    profile=install space=install
    mkdir -p .catkin_tools/profiles/install
    sed 's/^install: false/install: true/; s/^\(build\|devel\|log\)_space: .*/&_install/' \
      .catkin_tools/profiles/default/config.yaml >.catkin_tools/profiles/install/config.yaml
  fi
  catkin build --profile "$profile" --no-status --summarize --force-cmake \
    --cmake-args -DCMAKE_BUILD_TYPE=Release "-DPYTHON_EXECUTABLE=$VENV/bin/python3" || return
  # byte code of the generated messages: without it every node compiles them anew, a second and a half each
  "$VENV/bin/python3" -m compileall -q src "$space/lib/python3/dist-packages"
}

# Machine code of the planner's loops, in the user's cache folder: without it the first launch compiles for two minutes.
compile_loops() {
  local digest stamp planning="$ROOT/src/modular_framework_planning/src"
  [ "${INSTALL_SPACE:-0}" = 1 ] && planning="$ROOT/install/lib"
  digest=$({
    cat "$ROOT/requirements.txt"
    find "$planning" -name 'compiled_*.py' -printf '%p %T@\n' | sort
    find "$planning" \( -name 'compiled_*.py' -o -name compile_loops.py \) -print0 | sort -z | xargs -0 sha256sum
  } | sha256sum | cut -d' ' -f1)
  stamp="${XDG_CACHE_HOME:-$HOME/.cache}/modular_framework_planning/compiled_$digest"
  if [ -f "$stamp" ]; then
    say "      Compiled loops of the planner: up to date"
    return
  fi
  step "      Compiled loops of the planner: compiling (some minutes)" "read the messages above; then run this script again" \
    run_compile_loops
  touch "$stamp"
}

run_compile_loops() (
  source_workspace
  "$VENV/bin/python3" -m modular_framework_planning.process_setup.compile_loops
)

find_underlay() {
  UNDERLAY=""
  if [ -f "/opt/ros/noetic/setup.sh" ]; then
    UNDERLAY=/opt/ros/noetic
  fi
}

set_up_packages() {
  check_path
  check_system
  check_owner
  mkdir -p "$ROOT/logs"
  : >"$LOG"
  mount_what_a_bare_root_lacks
  install_debian_packages
  make_python_environment
}

set_up() {
  set_up_packages
  find_underlay
  build_workspace
  compile_loops
}

source_workspace() {
  local space=devel
  [ "${INSTALL_SPACE:-0}" = 1 ] && space=install
  # One computer: nodes listen on the loopback interface only, and its name need not resolve. A user's own choice wins.
  # ROS_IP, because C++ nodes bind to the loopback interface for a ROS_IP of 127.*, but not for such a ROS_HOSTNAME.
  if [ -z "${ROS_IP:-}${ROS_HOSTNAME:-}" ]; then
    export ROS_IP=127.0.0.1 ROS_MASTER_URI="${ROS_MASTER_URI:-http://127.0.0.1:11311}"
  fi
  set +u
  # shellcheck disable=SC1090,SC1091
  . "$ROOT/$space/setup.bash"
  set -u
}

main() {
  # an empty environment (a service, `env -i`) lacks what caches and ROS's own files are kept in
  [ -n "${HOME:-}" ] || HOME=$(getent passwd "$(id -u)" | cut -d: -f6) || fail "HOME is not set" "export HOME=FOLDER"
  export HOME
  local command=${1:-setup}
  [ $# = 0 ] || shift
  case $command in
    setup) set_up ;;
    packages) set_up_packages ;;
    run)
      set_up
      source_workspace
      exec rosrun modular_framework_api run_framework "$@"
      ;;
    experiment)
      set_up
      source_workspace
      exec rosrun modular_framework_benchmark run_experiment "$@"
      ;;
    test)
      set_up
      source_workspace
      cd "$ROOT"
      exec "$VENV/bin/python3" tests/run "$@"
      ;;
    doctor)
      find_underlay
      examine_build
      source_workspace
      exec rosrun modular_framework_setup doctor "$@"
      ;;
    exec)
      set_up
      source_workspace
      exec "$@"
      ;;
    site)
      set_up
      install_site_builder
      source_workspace
      export PYTHONPATH="$SITE_BUILDER:${PYTHONPATH:-}"
      exec "$VENV/bin/python3" "$ROOT/docs/site/build_site.py" "$@"
      ;;
    wheel)
      set_up_packages
      exec "$VENV/bin/pip" wheel --disable-pip-version-check --no-deps --wheel-dir "${1:-$ROOT/build_wheel}" "$ROOT"
      ;;
    shell)
      set_up
      source_workspace
      say "The workspace is sourced; 'exit' leaves this shell."
      exec bash -i
      ;;
    help | -h | --help) usage ;;
    *)
      usage >&2
      fail "unknown command '$command'" "use one of: run, experiment, test, doctor, shell, exec, site, wheel, packages, help"
      ;;
  esac
}

[ "${BASH_SOURCE[0]}" != "$0" ] || main "$@"
