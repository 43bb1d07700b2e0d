# SPDX-License-Identifier: BSD-3-Clause
"""Reads the xacro arguments of a description from roslaunch files.

A config package of MoveIt 1 defines them only in `launch/planning_context.launch`:
`<param name="robot_description_semantic" command="xacro .../robot.srdf.xacro hand:=$(arg load_gripper)"/>`.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path

from modular_framework_urdf.xml_text import Element

ARGUMENT = re.compile(r"\$\(arg +([^)\s]+) *\)")
"""Pattern of `$(arg NAME)` with the name as its group."""
_FIRST = ("planning_context.launch", "move_group.launch")
_SUBSTITUTION = re.compile(r"\$\([^()]*(?:\([^()]*\)[^()]*)*\)")
UNKNOWN = "$()"
"""Placeholder for a substitution of unknown value."""


def launch_files(package: Path) -> list[Path]:
    """Returns the roslaunch files of a package: first the files that load the robot, then the others by name.

    If the files have different defaults of an argument, the first file takes precedence.
    """
    files = (path for path in (package / "launch").glob("*") if path.name.endswith((".launch", ".launch.xml")))
    return sorted(files, key=lambda path: (path.name not in _FIRST, path.name))


def xacro_arguments(launch_files: Iterable[Element], file_name: str, values: Mapping[str, str]) -> dict[str, str]:
    """Returns the xacro arguments with known values that launch files pass to a description file.

    Args:
        launch_files: Root elements of the launch files. The first value of an argument takes precedence.
        file_name: Name of the xacro file.
        values: Values of the launch files' arguments.
    """
    arguments: dict[str, str] = {}
    for root in launch_files:
        for command in (item.get("command", "") for item in root.iter("param")):
            if file_name in command:
                arguments = {**known_arguments(command_words(command, values)), **arguments}
    return arguments


def known_arguments(words: Iterable[str]) -> dict[str, str]:
    """Returns the arguments `NAME:=VALUE` with known values among the words of a command."""
    pairs = (word.partition(":=") for word in words if UNKNOWN not in word)
    return {name: value for name, is_argument, value in pairs if is_argument}


def command_words(command: str, values: Mapping[str, str]) -> list[str]:
    """Splits a command into words as a shell does; returns an empty list for an unclosed quote.

    Args:
        command: Command with roslaunch substitutions such as `$(arg NAME)`. Unknown values become UNKNOWN.
        values: Values of the launch files' arguments.
    """
    substituted = ARGUMENT.sub(lambda match: values.get(match[1], UNKNOWN), command)
    try:
        return shlex.split(_SUBSTITUTION.sub(UNKNOWN, substituted))
    except ValueError:
        return []
