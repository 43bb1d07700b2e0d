# SPDX-License-Identifier: BSD-3-Clause
"""Checks nested parameters whose keys are names of the robot's joints, links or planning groups."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.parameter_declarations import Declaration, NodeDeclaration


@dataclass(frozen=True, slots=True)
class _Pattern:
    """Remaining parts of a declared name such as `{joint}/max_velocity`."""

    parts: tuple[str, ...]
    declared: Declaration


def tree_faults(
    parameters: Mapping[str, Any], below: NodeDeclaration, robot: Mapping[str, Collection[str]], parent: str = ""
) -> Iterator[str]:
    """Yields the error of each unknown name, invalid value and missing required value in nested parameters.

    Args:
        parameters: Nested parameters.
        below: Declaration of the names in the tree.
        robot: Names of the robot by kind, see `tree_fault`.
        parent: Name of the parent relative to the tree, with a slash at the end; "" at the top level.
    """
    for key, value in parameters.items():
        name = f"{parent}{key}"
        if isinstance(value, Mapping):
            yield from tree_faults(value, below, robot, f"{name}/")
        elif value is not None:
            fault = tree_fault(name, value, below, robot)
            yield from [f"parameter '{name}' {fault}"] if fault else []
    if not parent:
        for name, item in below.parameters.items():
            if item.required and parameters.get(name) is None:
                yield f"parameter '{name}' is not set; {item.requirement}"


def tree_fault(name: str, value: Any, below: NodeDeclaration, robot: Mapping[str, Collection[str]]) -> str:
    """Returns the error text for a nested parameter, which follows the parameter name in messages; "" if valid.

    Args:
        name: Name relative to the tree, such as `elbow_joint/max_velocity`.
        value: Value of the parameter.
        below: Declaration of the names in the tree; `{joint}` in a name stands for any joint.
        robot: Names of the robot by kind, such as `joint`. Names of an absent kind are not checked.
    """
    patterns = [_Pattern(tuple(key.split("/")), item) for key, item in below.parameters.items()]
    remaining_parts = tuple(name.split("/"))
    while remaining_parts:
        matches: list[tuple[int, _Pattern]] = []
        for pattern in patterns:
            length = _matched_length(pattern.parts[0], remaining_parts, robot) if pattern.parts else 0
            if length:
                matches.append((length, _Pattern(pattern.parts[1:], pattern.declared)))
        if not matches:
            return _unknown(remaining_parts[0], patterns, robot)
        longest = max(length for length, _ in matches)
        patterns = [pattern for length, pattern in matches if length == longest]
        remaining_parts = remaining_parts[longest:]
    complete = [pattern.declared for pattern in patterns if not pattern.parts]
    if not complete:
        return f"is {value!r}; allowed: {', '.join('/'.join(pattern.parts) for pattern in patterns)} below it"
    return complete[0].fault(value)


def _matched_length(part: str, remaining_parts: tuple[str, ...], robot: Mapping[str, Collection[str]]) -> int:
    """Returns the number of name parts that match a part of a pattern; 0 without a match.

    Variables of planar and floating joints have a slash in their names and match two parts.
    """
    if not part.startswith("{"):
        return int(remaining_parts[0] == part)
    known = robot.get(part.strip("{}"))
    if known is None:
        return 1
    return next(
        (length for length in (2, 1) if len(remaining_parts) >= length and "/".join(remaining_parts[:length]) in known),
        0,
    )


def _unknown(part: str, patterns: list[_Pattern], robot: Mapping[str, Collection[str]]) -> str:
    firsts = list(dict.fromkeys(pattern.parts[0] for pattern in patterns if pattern.parts))
    kinds = [first.strip("{}") for first in firsts if first.startswith("{")]
    words = [*kinds, *(["parameter"] if len(kinds) < len(firsts) or not firsts else [])]
    names = [name for first in firsts for name in (robot[first.strip("{}")] if first.startswith("{") else [first])]
    return f"names no {' or '.join(words)}: '{part}'; {listing(names, 'there is none')}{nearest(part, names)}"
