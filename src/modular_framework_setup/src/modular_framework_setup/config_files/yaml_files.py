# SPDX-License-Identifier: BSD-3-Clause
"""Reads the YAML files of a config package with their lines, and their values as rosparam reads them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from collections.abc import Mapping as Values
from pathlib import Path

from modular_framework_core.files.faults import FaultList, SourceLocation, TaskFault
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of, loads

_ARGUMENT = re.compile(r"\$\(arg (\w+)\)")
_TRUTH = {"yes": True, "on": True, "no": False, "off": False}  # of YAML 1.1, which rosparam reads
_ANGLE = re.compile(r"(rad|deg)\(.+\)")  # of rosparam
_ANGLE_TAG = re.compile(r"!(degrees|radians)[ \t]+([-+.\deE]+)")  # of rosparam


def load_yaml(path: Path, faults: FaultList, arguments: Values[str, str] | None = None) -> Mapping | None:
    """Reads a YAML file whose top level is a mapping.

    Args:
        path: the file.
        faults: where it is noted that the file is no YAML, or that a key occurs twice.
        arguments: values for `$(arg NAME)`, which launch files may have replaced; others stay as they are written.

    Returns:
        The mapping; None for a file that is empty or no mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        faults.add(SourceLocation(str(path), 1, 1), f"cannot be read ({error}); a readable text file is needed")
        return None
    if all(not line.strip() or line.lstrip().startswith(("#", "---")) for line in text.splitlines()):
        return None
    given = arguments or {}
    text = _ARGUMENT.sub(lambda match: given.get(match[1], match[0]), _ANGLE_TAG.sub(_radians, text))
    try:
        node = loads(text, str(path), faults)
    except TaskFault as error:
        for fault in error.faults:
            faults.add(fault.location, f"{fault.message}; correct this line")
        return None
    if isinstance(node, Mapping):
        return node
    faults.add(node.location, f"the file holds {kind_of(node)}; a mapping of names to values is needed")
    return None


def _radians(tagged: re.Match[str]) -> str:
    try:
        value = float(tagged[2])
    except ValueError:
        return tagged[0]
    return repr(math.radians(value) if tagged[1] == "degrees" else value)


def is_open(text: str) -> bool:
    """Whether a text holds an argument of a launch file whose value is not known here."""
    return "$(" in text


def plain_text(node: Node | None) -> str:
    """Returns a scalar as text; empty for anything else."""
    return str(node.value) if isinstance(node, Scalar) and node.value is not None else ""


def texts(node: Node | None) -> list[tuple[str, SourceLocation]]:
    """Returns the entries of a list that are text, each with its location; a single text is a list of one."""
    items = node.items if isinstance(node, Sequence) else (node,)
    return [
        (str(item.value), item.location) for item in items if isinstance(item, Scalar) and isinstance(item.value, str)
    ]


def mappings(node: Node | None) -> Iterator[tuple[str, SourceLocation, Mapping]]:
    """Yields the entries of a mapping that are mappings themselves: key, its location, value."""
    if isinstance(node, Mapping):
        for key, value in node.entries.items():
            if isinstance(value, Mapping):
                yield key, node.keys[key], value


def parameters_of(top: Mapping) -> Mapping:
    """Returns what is below NAME/ros__parameters in a file of ROS 2 with one name, else the mapping itself."""
    if len(top.entries) == 1:
        inner = next(iter(top.entries.values()))
        if isinstance(inner, Mapping) and isinstance(below := inner.entries.get("ros__parameters"), Mapping):
            return below
    return top


def read_number(node: Node, what: str, faults: FaultList) -> float | None:
    """Returns a number; notes anything else, and returns None for it and for an angle in rosparam's own notation."""
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if not (isinstance(value, str) and (_ANGLE.fullmatch(value) or is_open(value))):
        faults.add(node.location, f"{what} is {kind_of(node)}; expected a number; correct it")
    return None


def read_truth(node: Node, what: str, faults: FaultList) -> bool | None:
    """Returns a truth value; notes anything else and returns None."""
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, str):
        if is_open(value):
            return None
        value = _TRUTH.get(value.lower(), value)
    if isinstance(value, bool):
        return value
    faults.add(node.location, f"{what} is {kind_of(node)}; expected true or false; correct it")
    return None
