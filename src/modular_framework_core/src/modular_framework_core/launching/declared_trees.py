# SPDX-License-Identifier: BSD-3-Clause
"""Checks parameters below a name whose further parts are names of joints, links or planning groups of the robot."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_core.files.faults import listing, nearest
from modular_framework_ros.parameter_declarations import Declaration, NodeDeclaration


@dataclass(frozen=True, slots=True)
class _Pattern:
    """The rest of a declared name such as `{joint}/max_velocity`, by its parts."""

    parts: tuple[str, ...]
    declared: Declaration


def tree_fault(name: str, value: Any, below: NodeDeclaration, robot: Mapping[str, Collection[str]]) -> str:
    """Returns what is wrong with a parameter below a tree, in words that follow its name; empty if nothing is.

    Args:
        name: Name of the parameter below the tree, such as `elbow_joint/max_velocity`.
        value: Its value.
        below: Declaration of the names below the tree; `{joint}` in a name stands for each joint.
        robot: Names by kind, such as `joint`; a kind that is missing may have any names.
    """
    patterns = [_Pattern(tuple(key.split("/")), item) for key, item in below.parameters.items()]
    rest = tuple(name.split("/"))
    while rest:
        fitting: list[tuple[int, _Pattern]] = []
        for pattern in patterns:
            length = _length(pattern.parts[0], rest, robot) if pattern.parts else 0
            if length:
                fitting.append((length, _Pattern(pattern.parts[1:], pattern.declared)))
        if not fitting:
            return _unknown(rest[0], patterns, robot)
        longest = max(length for length, _ in fitting)
        patterns = [pattern for length, pattern in fitting if length == longest]
        rest = rest[longest:]
    whole = [pattern.declared for pattern in patterns if not pattern.parts]
    if not whole:
        return f"is {value!r}; allowed: {', '.join('/'.join(pattern.parts) for pattern in patterns)} below it"
    return whole[0].fault(value)


def _length(part: str, rest: tuple[str, ...], robot: Mapping[str, Collection[str]]) -> int:
    """Returns the number of parts of a name that a part of a pattern stands for; 0 if it does not fit.

    The variables of a planar or floating joint have a slash in their names.
    """
    if not part.startswith("{"):
        return int(rest[0] == part)
    known = robot.get(part.strip("{}"))
    if known is None:
        return 1
    return next((length for length in (2, 1) if len(rest) >= length and "/".join(rest[:length]) in known), 0)


def _unknown(part: str, patterns: list[_Pattern], robot: Mapping[str, Collection[str]]) -> str:
    kinds: list[str] = []
    names: list[str] = []
    for first in dict.fromkeys(pattern.parts[0] for pattern in patterns if pattern.parts):
        kind = first.strip("{}") if first.startswith("{") else ""
        kinds += [kind] if kind else []
        names += robot[kind] if kind else [first]
    what = " or ".join(kinds) if kinds else "parameter"
    return f"names no {what}: '{part}'; {listing(names, 'there is none')}{nearest(part, names)}"
