# SPDX-License-Identifier: BSD-3-Clause
"""Checks the launch arguments of the framework if users start plain roslaunch.

roslaunch runs this module as the command of a parameter, before any node, and stops if the command fails. roslaunch
ignores unknown arguments of a launch file; the command line of the parent process contains them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil
import roslaunch
import roslaunch.core
import roslaunch.rlutil

from modular_framework_core.launching.launch_arguments import known_arguments, unknown_argument
from modular_framework_core.launching.launch_values import value_faults

ROSLAUNCH = "roslaunch"
FAILURE_NOTE = "Nothing was started. The error of roslaunch that follows only says that this check failed."


def unknown_arguments(command: Sequence[str]) -> Iterator[str]:
    """Yields the fault of each argument that the launch files of a command line do not have.

    Args:
        command: Words of the command line, such as `python3 roslaunch PACKAGE FILE NAME:=VALUE`; without roslaunch as
            the program or its script, there are no faults.
    """
    programs = [Path(word).name for word in command[:2]]
    if ROSLAUNCH not in programs:
        return
    words = roslaunch._get_optparse().parse_args(list(command[programs.index(ROSLAUNCH) + 1 :]))[1]
    try:
        files = roslaunch.rlutil.resolve_launch_arguments(words)
        known_names = {name for file in files for name in known_arguments(file)}
    except roslaunch.core.RLException:
        return  # roslaunch reports the reason
    for word in words:
        name, sign, _ = word.partition(":=")
        if sign and not name.startswith("_") and name not in known_names:
            yield unknown_argument(name, known_names)


def main(arguments: list[str]) -> int:
    """Prints the faults of the arguments and returns 1 if there are any, which makes roslaunch stop.

    Args:
        arguments: Values of checked arguments, `NAME:=VALUE ...`.
    """
    values = dict(argument.split(":=", 1) for argument in arguments)
    faults = [*unknown_arguments(psutil.Process(os.getppid()).cmdline()), *value_faults(values)]
    for fault in faults:
        print(fault, file=sys.stderr)
    if faults:
        print(FAILURE_NOTE, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
