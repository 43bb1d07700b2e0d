# SPDX-License-Identifier: BSD-3-Clause
"""Reads with which xacro arguments a launch file of roslaunch expands a description.

A config package of MoveIt 1 says so in `launch/planning_context.launch` and nowhere else:
`<param name="robot_description_semantic" command="xacro .../robot.srdf.xacro hand:=$(arg load_gripper)"/>`.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path

from modular_framework_urdf.xml_text import Element

ARGUMENT = re.compile(r"\$\(arg +([^)\s]+) *\)")
"""`$(arg NAME)`; its group is the name."""
_FIRST = ("planning_context.launch", "move_group.launch")
_SUBSTITUTION = re.compile(r"\$\([^()]*(?:\([^()]*\)[^()]*)*\)")
UNKNOWN = "$()"
"""What stands for a substitution whose value is not known."""


def launch_files(package: Path) -> list[Path]:
    """Returns a package's launch files of roslaunch: those that load the robot first, then in order of their names.

    The first is the one to believe where they give an argument different defaults.
    """
    files = (path for path in (package / "launch").glob("*") if path.name.endswith((".launch", ".launch.xml")))
    return sorted(files, key=lambda path: (path.name not in _FIRST, path.name))


def xacro_arguments(launch_files: Iterable[Element], file_name: str, values: Mapping[str, str]) -> dict[str, str]:
    """Returns the xacro arguments that launch files give a description, those whose values are known.

    Args:
        launch_files: their root elements; of several values of an argument the first counts.
        file_name: of the xacro file.
        values: of the launch files' arguments.
    """
    found: dict[str, str] = {}
    for root in launch_files:
        for command in (item.get("command", "") for item in root.iter("param")):
            if file_name in command:
                found = {**known_arguments(command_words(command, values)), **found}
    return found


def known_arguments(words: Iterable[str]) -> dict[str, str]:
    """Returns the arguments among the words of a command, `NAME:=VALUE`, those whose values are known."""
    pairs = (word.partition(":=") for word in words if UNKNOWN not in word)
    return {name: value for name, is_argument, value in pairs if is_argument}


def command_words(command: str, values: Mapping[str, str]) -> list[str]:
    """Returns the words of a command as a shell would, with UNKNOWN for what is not known; none if a quote is open.

    Args:
        command: may have substitutions of roslaunch, such as `$(arg NAME)`.
        values: of the launch files' arguments.
    """
    known = ARGUMENT.sub(lambda match: values.get(match[1], UNKNOWN), command)
    try:
        return shlex.split(_SUBSTITUTION.sub(UNKNOWN, known))
    except ValueError:
        return []
