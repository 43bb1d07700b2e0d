# SPDX-License-Identifier: BSD-3-Clause
"""Reads the YAML files of a config package with line numbers and with rosparam's rules for values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from collections.abc import Mapping as Values
from pathlib import Path

from modular_framework_core.files.faults import FaultList, SourceLocation, TaskFault
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of, loads

_ARGUMENT = re.compile(r"\$\(arg (\w+)\)")
_TRUTH = {"yes": True, "on": True, "no": False, "off": False}  # YAML 1.1, as in rosparam
_ANGLE = re.compile(r"(rad|deg)\(.+\)")  # rosparam's notation
_ANGLE_TAG = re.compile(r"!(degrees|radians)[ \t]+([-+.\deE]+)")  # rosparam's notation


def load_yaml(path: Path, faults: FaultList, arguments: Values[str, str] | None = None) -> Mapping | None:
    """Reads a YAML file whose top level is a mapping.

    Args:
        path: Path of the file.
        faults: Receives faults such as invalid YAML and duplicate keys.
        arguments: Values that replace `$(arg NAME)`, as launch files do. Unknown arguments stay unchanged.

    Returns:
        The mapping, or None if the file is empty or not a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        faults.add(SourceLocation(str(path), 1, 1), f"cannot be read ({error}); make it a readable text file")
        return None
    if all(not line.strip() or line.lstrip().startswith(("#", "---")) for line in text.splitlines()):
        return None
    values = arguments or {}
    text = _ARGUMENT.sub(lambda match: values.get(match[1], match[0]), _ANGLE_TAG.sub(_radians, text))
    try:
        node = loads(text, str(path), faults)
    except TaskFault as error:
        for fault in error.faults:
            faults.add(fault.location, f"{fault.message}; correct this line")
        return None
    if isinstance(node, Mapping):
        return node
    faults.add(node.location, f"the file contains {kind_of(node)}; it must be a mapping of names to values")
    return None


def _radians(tagged: re.Match[str]) -> str:
    try:
        value = float(tagged[2])
    except ValueError:
        return tagged[0]
    return repr(math.radians(value) if tagged[1] == "degrees" else value)


def has_argument(text: str) -> bool:
    """Returns whether a text contains a launch argument of unknown value."""
    return "$(" in text


def plain_text(node: Node | None) -> str:
    """Returns a scalar as text, or "" for anything else."""
    return str(node.value) if isinstance(node, Scalar) and node.value is not None else ""


def texts(node: Node | None) -> list[tuple[str, SourceLocation]]:
    """Returns the texts in a list, or a single text, with their locations."""
    items = node.items if isinstance(node, Sequence) else (node,)
    return [
        (str(item.value), item.location) for item in items if isinstance(item, Scalar) and isinstance(item.value, str)
    ]


def mappings(node: Node | None) -> Iterator[tuple[str, SourceLocation, Mapping]]:
    """Yields (key, location of the key, value) for all values that are mappings."""
    if isinstance(node, Mapping):
        for key, value in node.entries.items():
            if isinstance(value, Mapping):
                yield key, node.keys[key], value


def parameters_of(top: Mapping) -> Mapping:
    """Returns the parameters below NAME/ros__parameters in a ROS 2 file with one name, or else the mapping itself."""
    if len(top.entries) == 1:
        node = next(iter(top.entries.values()))
        if isinstance(node, Mapping) and isinstance(parameters := node.entries.get("ros__parameters"), Mapping):
            return parameters
    return top


def read_number(node: Node, noun: str, faults: FaultList) -> float | None:
    """Returns a number, or None for anything else. Angles in rosparam's notation add no fault.

    Args:
        node: YAML node.
        noun: Name of the value, for messages.
        faults: Receives a fault.
    """
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if not (isinstance(value, str) and (_ANGLE.fullmatch(value) or has_argument(value))):
        faults.add(node.location, f"{noun} is {kind_of(node)}; expected a number; correct it")
    return None


def read_truth(node: Node, noun: str, faults: FaultList) -> bool | None:
    """Returns a truth value, or None with a fault for anything else.

    Args:
        node: YAML node.
        noun: Name of the value, for messages.
        faults: Receives a fault.
    """
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, str):
        if has_argument(value):
            return None
        value = _TRUTH.get(value.lower(), value)
    if isinstance(value, bool):
        return value
    faults.add(node.location, f"{noun} is {kind_of(node)}; expected true or false; correct it")
    return None
