# Puts this package's command xacro before the one of PyPI on PATH: launch files call it by its bare name.
_xacro_folder="${CATKIN_ENV_HOOK_WORKSPACE}/lib/xacro"
PATH=$(printf '%s' "${PATH}" | tr ':' '\n' | grep -vxF "${_xacro_folder}" | paste -sd ':' -)
export PATH="${_xacro_folder}:${PATH}"
unset _xacro_folder
