# SPDX-License-Identifier: BSD-3-Clause
"""Reads single fields of a machine or state.

Each function returns the value, or adds a fault and returns None.
"""

from __future__ import annotations

import importlib.util
import keyword
import re

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of

MAX_NAME_LENGTH = 100
_LABEL = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_NODE_NAME = re.compile(r"/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


def text(node: Node, label: str, faults: FaultList) -> str | None:
    """Returns a nonempty text.

    Args:
        node: Value of the field.
        label: Name of the field, for messages.
        faults: Receives the faults.
    """
    if isinstance(node, Scalar) and isinstance(node.value, str) and node.value:
        return node.value
    faults.add(node.location, f"{label} must be a text, found {kind_of(node)}")
    return None


def identifier(node: Node, label: str, faults: FaultList) -> str | None:
    """Returns a text that is a valid name of a Python module and class.

    Args:
        node: Value of the field.
        label: Name of the field, for messages.
        faults: Receives the faults.
    """
    name = text(node, label, faults)
    if name is None:
        return None
    fault = module_name_fault(name)
    if fault:
        faults.add(node.location, f"{label} '{name}' {fault}")
    return None if fault else name


def module_name_fault(name: str) -> str:
    """Returns why a text is not a valid name of a generated module; "" if valid."""
    if not name.isidentifier() or not name.isascii() or keyword.iskeyword(name):
        return "must be letters, digits and underscores, and start with a letter"
    if len(name) > MAX_NAME_LENGTH:
        return f"has {len(name)} characters; a file name may have {MAX_NAME_LENGTH}; shorten it"
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is not None and spec.origin:
        return (
            f"is the Python module {spec.origin}, which a generated file of that name would hide; choose another name"
        )
    return ""


def node_name(node: Node, faults: FaultList) -> str | None:
    """Returns a text that is a valid name of a ROS node."""
    name = text(node, "node_name", faults)
    if name is None or _NODE_NAME.fullmatch(name):
        return name
    faults.add(node.location, f"node_name '{name}' must be letters, digits and underscores, and start with a letter")
    return None


def label(name: str, location: SourceLocation, faults: FaultList) -> None:
    """Checks the label of a state.

    Args:
        name: Label.
        location: Place of the label in the task file.
        faults: List that receives a fault of the label.
    """
    if not _LABEL.fullmatch(name):
        faults.add(location, f"the label '{name}' must be letters, digits, _ and -, and start with a letter")


def names(
    node: Node, label: str, faults: FaultList, *, may_be_empty: bool = False, example: str = "[success, fail]"
) -> tuple[str, ...] | None:
    """Returns a list of distinct names.

    Args:
        node: Value of the field.
        label: Name of the field, for messages.
        faults: Receives the faults.
        may_be_empty: Whether the list may be empty.
        example: Valid value, for messages.
    """
    if not isinstance(node, Sequence):
        faults.add(node.location, f"{label} must be a list such as {example}, found {kind_of(node)}")
        return None
    if not node.items and not may_be_empty:
        faults.add(node.location, f"{label} is an empty list; it needs at least one name")
        return None
    result: list[str] = []
    for item in node.items:
        name = text(item, f"each of {label}", faults)
        if name is None:
            return None
        if name in result:
            faults.add(item.location, f"{label} has '{name}' twice")
            return None
        result.append(name)
    return tuple(result)


def name_map(
    node: Node, label: str, faults: FaultList, *, example: str = "{success: NextState}"
) -> dict[str, Scalar] | None:
    """Returns a mapping from names to names, with the location of each value.

    Args:
        node: Value of the field.
        label: Name of the field, for messages.
        faults: Receives the faults.
        example: Valid value, for messages.
    """
    if not isinstance(node, Mapping):
        faults.add(node.location, f"{label} must be a mapping such as {example}, found {kind_of(node)}")
        return None
    result: dict[str, Scalar] = {}
    for key, value in node.entries.items():
        if isinstance(value, Scalar) and isinstance(value.value, str) and value.value:
            result[key] = value
        else:
            faults.add(value.location, f"{label}: the value of '{key}' must be a name, found {kind_of(value)}")
    return result if len(result) == len(node.entries) else None
