# SPDX-License-Identifier: BSD-3-Clause
"""Merges the settings of the base and of the levels of an experiment file; every value keeps its line and column."""

from __future__ import annotations

import re
from collections.abc import Iterator
from collections.abc import Mapping as Map

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence
from modular_framework_ros.allowed_names import listing, nearest

_REFERENCE = re.compile(r"\$(\$|[A-Za-z_][A-Za-z0-9_-]*)")


def references(node: Node) -> Iterator[tuple[str, Scalar]]:
    """Yields each `$NAME` in the texts of a value, with its text."""
    match node:
        case Scalar(value=str(text)):
            for name in _REFERENCE.findall(text):
                if name != "$":
                    yield name, node
        case Scalar():
            return
        case Sequence():
            for item in node.items:
                yield from references(item)
        case Mapping():
            for value in node.entries.values():
                yield from references(value)


def check_references(node: Node, factors: Map[str, object], faults: FaultList) -> list[str]:
    """Adds a fault for each `$NAME` that is not a factor, and returns these names.

    Args:
        node: Value to search.
        factors: Factors by name.
        faults: List to which faults are added.
    """
    unknown = []
    for name, text in references(node):
        if name not in factors:
            unknown.append(name)
            faults.add(
                text.location,
                f"'${name}' names no factor; {listing(factors)}{nearest(name, factors)}; write $$ for a dollar sign",
            )
    return unknown


def substitute_levels(node: Node, levels: Map[str, Scalar]) -> Node:
    """Returns a value in which each `$NAME` is replaced by the level of that factor.

    Args:
        node: Value of the file.
        levels: Level of each factor. A text that equals `$NAME` becomes the level itself and keeps its type.
    """
    match node:
        case Scalar(value=str(text)):
            name = text[1:]
            if text.startswith("$") and name in levels:
                return Scalar(levels[name].value, node.location)
            return Scalar(_REFERENCE.sub(lambda reference: _text_of(reference[1], levels), text), node.location)
        case Scalar():
            return node
        case Sequence():
            return Sequence(tuple(substitute_levels(item, levels) for item in node.items), node.location)
        case Mapping():
            entries = {key: substitute_levels(value, levels) for key, value in node.entries.items()}
            return Mapping(entries, node.keys, node.location)


def _text_of(name: str, levels: Map[str, Scalar]) -> str:
    if name == "$":
        return "$"
    return level_label(levels[name]) if name in levels else f"${name}"


def level_label(level: Scalar) -> str:
    """Returns the label of a level as text."""
    return str(level.value).lower() if isinstance(level.value, bool) else str(level.value)


def merge_settings(base: Mapping, over: Mapping) -> Mapping:
    """Returns the base overridden by another mapping; mappings in both are merged recursively."""
    entries, keys = dict(base.entries), base.keys | over.keys
    for key, value in over.entries.items():
        before = entries.get(key)
        both = isinstance(before, Mapping) and isinstance(value, Mapping)
        entries[key] = merge_settings(before, value) if both else value  # type: ignore[arg-type]
    return Mapping(entries, keys, over.location if over.entries else base.location)


def leaves(node: Mapping, above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Node]]:
    """Yields the leaf values of nested mappings with the keys that lead to them."""
    for key, value in node.entries.items():
        if isinstance(value, Mapping) and value.entries:
            yield from leaves(value, (*above, key))
        else:
            yield (*above, key), value


def location_below(node: Mapping, keys: tuple[str, ...]) -> SourceLocation:
    """Returns the location of the value that the keys lead to, or of the innermost value above it."""
    value: Node = node
    for key in keys:
        if not isinstance(value, Mapping):
            break
        name = key if key in value.entries else next((name for name in value.entries if key.startswith(f"{name}/")), "")
        if not name:
            break
        value = value.entries[name]
    return value.location
