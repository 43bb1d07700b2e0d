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
_UNKNOWN = "$()"


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
            for word in _words(command, values) if file_name in command else ():
                name, is_argument, value = word.partition(":=")
                if is_argument and _UNKNOWN not in word:
                    found.setdefault(name, value)
    return found


def _words(command: str, values: Mapping[str, str]) -> list[str]:
    """Returns the words of a command as a shell would, with `$()` for what is not known; none if it has open quotes."""
    known = ARGUMENT.sub(lambda match: values.get(match[1], _UNKNOWN), command)
    try:
        return shlex.split(_SUBSTITUTION.sub(_UNKNOWN, known))
    except ValueError:
        return []
