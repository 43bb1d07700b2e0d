# SPDX-License-Identifier: BSD-3-Clause
"""Checks the launch arguments of the framework if users start plain roslaunch.

roslaunch runs this module as the command of a parameter, before any node, and stops if the command fails. roslaunch
ignores unknown arguments of a launch file; the command line of the parent process contains them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import psutil
import roslaunch
import roslaunch.core
import roslaunch.rlutil
import rospkg

from modular_framework_core.launching.launch_arguments import (
    argument_values,
    known_arguments,
    load_error_text,
    unknown_argument,
)
from modular_framework_core.launching.launch_values import value_faults

NameFaults = Callable[[Sequence[str], list[str]], Sequence[str]]
ROSLAUNCH = "roslaunch"
FAILURE_NOTE = "Nothing was started. The error of roslaunch that follows only says that this check failed."


def launched_files(command: Sequence[str]) -> tuple[list[str], list[str]]:
    """Returns launch files and arguments `NAME:=VALUE` of a command line, or empty lists if there are no such files.

    Args:
        command: Words of the command line, such as `python3 roslaunch PACKAGE FILE NAME:=VALUE`; without roslaunch as
            the program or its script, there are no files.
    """
    programs = [Path(word).name for word in command[:2]]
    if ROSLAUNCH not in programs:
        return [], []
    words = roslaunch._get_optparse().parse_args(list(command[programs.index(ROSLAUNCH) + 1 :]))[1]
    try:
        files = roslaunch.rlutil.resolve_launch_arguments(words)
    except roslaunch.core.RLException:
        return [], []  # roslaunch reports the reason
    return files, [word for word in words if ":=" in word]


def unknown_arguments(files: Sequence[str], arguments: Sequence[str]) -> Iterator[str]:
    """Yields the fault of each argument that the launch files do not have."""
    try:
        known_names = {name for file in files for name in known_arguments(file)}
    except roslaunch.core.RLException:
        return  # roslaunch reports the reason
    for argument in arguments:
        name = argument.partition(":=")[0]
        if files and not name.startswith("_") and name not in known_names:
            yield unknown_argument(name, known_names)


def _values_of_files(files: Sequence[str], arguments: list[str]) -> dict[str, str]:
    """Returns the values of all arguments of the launch files."""
    try:
        return {name: value for file in files for name, value in argument_values(file, arguments).items()}
    except (roslaunch.core.RLException, rospkg.ResourceNotFound):
        return {}  # roslaunch reports the reason


def main(arguments: list[str], name_faults: NameFaults = lambda files, arguments: ()) -> int:
    """Prints the faults of the launch and returns 1 if there are any, which makes roslaunch stop.

    Args:
        arguments: Values of checked arguments, `NAME:=VALUE ...`.
        name_faults: Function that returns the faults of the names in launch files and their arguments. The function is
            called only for plain roslaunch and sound arguments.
    """
    files, given = launched_files(psutil.Process(os.getppid()).cmdline())
    values = _values_of_files(files, given) | dict(argument.split(":=", 1) for argument in arguments)
    faults = [*unknown_arguments(files, given), *value_faults(values)]
    if files and not faults:
        try:
            faults = [*name_faults(files, given)]
        except (roslaunch.core.RLException, rospkg.ResourceNotFound, ValueError) as error:
            faults = [load_error_text(error, files[0], given)]
    for fault in faults:
        print(fault, file=sys.stderr)
    if faults:
        print(FAILURE_NOTE, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
