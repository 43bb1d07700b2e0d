# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML (1.2, safe types only) into a tree that remembers the line and column of every key and value."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import ScalarNode, SequenceNode

from modular_framework_core.task_constructor.faults import Fault, FaultList, Place, TaskFault

MAX_NODES = 200_000
"""Largest number of values in a file after its aliases are expanded: a guard against files that blow up."""

_ALLOWED_SCALARS = (str, bool, int, float, type(None))
_MERGE_TAG = "tag:yaml.org,2002:merge"


@dataclass(frozen=True, slots=True)
class Scalar:
    """Text, number, truth value or nothing."""

    value: str | bool | int | float | None
    place: Place

    def plain(self) -> Any:
        """Return the value itself."""
        return self.value


@dataclass(frozen=True, slots=True)
class Sequence:
    """A list."""

    items: tuple[Node, ...]
    place: Place

    def plain(self) -> list[Any]:
        """Return a Python list of plain values."""
        return [item.plain() for item in self.items]


@dataclass(frozen=True, slots=True)
class Mapping:
    """A mapping whose keys are unique; ``keys`` has the place of each key."""

    entries: dict[str, Node]
    keys: dict[str, Place]
    place: Place

    def plain(self) -> dict[str, Any]:
        """Return a Python dict of plain values."""
        return {key: value.plain() for key, value in self.entries.items()}

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)


Node = Union[Scalar, Sequence, Mapping]  # noqa: UP007 - the classes above refer to it by name


def kind_of(node: Node) -> str:
    """Name the kind of a value, for messages."""
    match node:
        case Mapping():
            return "a mapping"
        case Sequence():
            return "a list"
        case Scalar(value=None):
            return "nothing"
        case Scalar(value=bool()):
            return f"the truth value {str(node.value).lower()}"
        case Scalar(value=str()):
            return f"the text '{node.value}'"
        case _:
            return f"the number {node.plain()}"


def load(path: Path) -> Node:
    """Read a YAML file.

    Raises:
        TaskFault: the file cannot be read, is empty, is no valid YAML, repeats a key, or has a value of another
            type than text, number, truth value, list and mapping.
    """
    start = Place(str(path), 1, 1)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TaskFault([Fault(start, f"the file cannot be read: {error}")]) from error
    return loads(text, str(path))


def loads(text: str, file: str) -> Node:
    """Read YAML from text; ``file`` is the name used in messages. Raises as ``load`` does."""
    reader = YAML(typ="safe", pure=True)
    try:
        root = reader.compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(file, mark.line + 1, mark.column + 1) if mark else Place(file, 1, 1)
        context = f" {error.context}" if error.context else ""
        raise TaskFault([Fault(place, f"this is not valid YAML: {error.problem}{context}")]) from error
    except (YAMLError, RecursionError, ValueError, LookupError, TypeError) as error:
        first_line = (str(error).splitlines() or [""])[0]
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else first_line
        raise TaskFault([Fault(Place(file, 1, 1), f"this is not valid YAML: {reason}")]) from error
    if root is None:
        raise TaskFault([Fault(Place(file, 1, 1), "the file is empty; a task needs name, source, outcomes and states")])
    return _Converter(reader, file).convert(root)


class _Converter:
    """Turns ruamel's nodes into ours."""

    def __init__(self, reader: YAML, file: str) -> None:
        self._reader = reader
        self._file = file
        self._faults = FaultList()
        self._count = 0
        self._open: set[int] = set()

    def convert(self, root: Any) -> Node:
        """Convert a whole document; raise ``TaskFault`` with all that is wrong with its values."""
        node = self._node(root)
        self._faults.raise_if_any()
        return node

    def _place(self, node: Any) -> Place:
        return Place(self._file, node.start_mark.line + 1, node.start_mark.column + 1)

    def _node(self, node: Any) -> Node:
        self._count += 1
        place = self._place(node)
        if self._count > MAX_NODES:
            raise TaskFault([Fault(place, f"the file has more than {MAX_NODES} values once aliases are expanded")])
        if id(node) in self._open:
            raise TaskFault([Fault(place, "this value contains itself through an alias")])
        self._open.add(id(node))
        try:
            if isinstance(node, ScalarNode):
                return self._scalar(node, place)
            if not isinstance(node, ScalarNode) and not str(node.tag).endswith((":seq", ":map")):
                self._faults.add(place, f"the tag {node.tag} cannot be used here")
            if isinstance(node, SequenceNode):
                return Sequence(tuple(self._node(item) for item in node.value), place)
            return self._mapping(node, place)
        finally:
            self._open.discard(id(node))

    def _scalar(self, node: Any, place: Place) -> Scalar:
        try:
            value = self._reader.constructor.construct_object(node, deep=True)
        except Exception:  # for a tag that does not fit the text, the library raises whatever comes first
            self._faults.add(place, f"the tag or value '{node.value}' of type {node.tag} cannot be used here")
            return Scalar(None, place)
        if isinstance(value, _ALLOWED_SCALARS):
            return Scalar(value, place)
        self._faults.add(place, f"'{node.value}' is read as a {type(value).__name__}; put it in quotes to make it text")
        return Scalar(None, place)

    def _mapping(self, node: Any, place: Place) -> Mapping:
        entries: dict[str, Node] = {}
        keys: dict[str, Place] = {}
        merged: list[Mapping] = []
        for key_node, value_node in node.value:
            if str(key_node.tag) == _MERGE_TAG:
                merged.extend(self._merged(value_node))
                continue
            key = self._key(key_node)
            if key is None:
                continue
            if key in entries:
                place_again = self._place(key_node)
                self._faults.add(place_again, f"the key '{key}' is given twice; first in line {keys[key].line}")
                continue
            entries[key] = self._node(value_node)
            keys[key] = self._place(key_node)
        for other in merged:
            for key in other:
                if key not in entries:
                    entries[key], keys[key] = other.entries[key], other.keys[key]
        return Mapping(entries, keys, place)

    def _merged(self, node: Any) -> list[Mapping]:
        value = self._node(node)
        found = list(value.items) if isinstance(value, Sequence) else [value]
        mappings = [item for item in found if isinstance(item, Mapping)]
        if len(mappings) != len(found):
            self._faults.add(value.place, f"'<<' takes a mapping or a list of mappings, found {kind_of(value)}")
        return mappings

    def _key(self, node: Any) -> str | None:
        value = self._node(node)
        if isinstance(value, Scalar) and isinstance(value.value, str) and value.value:
            return value.value
        self._faults.add(value.place, f"a key must be text, found {kind_of(value)}; put it in quotes")
        return None
