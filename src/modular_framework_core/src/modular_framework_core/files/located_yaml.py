# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML 1.2 (safe types only) into a tree with the line and column of every key and value."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

import yaml

from modular_framework_core.files.atomic_files import read_text
from modular_framework_core.files.faults import Fault, FaultList, SourceLocation, TaskFault
from modular_framework_core.files.shallow_yaml import MAX_DEPTH
from modular_framework_ros.allowed_names import listing, nearest

MAX_NODES = 500_000
"""Maximum number of values after alias expansion, which can grow exponentially."""

_TAG = "tag:yaml.org,2002:"
_MERGE_KEY = "<<"
# non-text scalars of YAML 1.2's core schema: type, pattern, conversion
_CORE: tuple[tuple[str, re.Pattern[str], Callable[[str], Any]], ...] = (
    ("null", re.compile(r"null|Null|NULL|~|"), lambda text: None),
    ("bool", re.compile(r"true|True|TRUE|false|False|FALSE"), lambda text: text[0] in "tT"),
    ("int", re.compile(r"[-+]?[0-9]+"), int),
    ("int", re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+"), lambda text: int(text, 0)),
    ("float", re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"), float),
    ("float", re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"), lambda text: float(text.replace(".", "", 1))),
)


@dataclass(frozen=True, slots=True)
class Scalar:
    """A text, number, bool or null."""

    value: str | bool | int | float | None
    location: SourceLocation

    def plain(self) -> Any:
        """Returns the value itself."""
        return self.value


@dataclass(frozen=True, slots=True)
class Sequence:
    """A list."""

    items: tuple[Node, ...]
    location: SourceLocation

    def plain(self) -> list[Any]:
        """Returns a Python list of plain values."""
        return [item.plain() for item in self.items]


@dataclass(frozen=True, slots=True)
class Mapping:
    """A mapping with unique keys; ``keys`` contains the location of each key."""

    entries: dict[str, Node]
    keys: dict[str, SourceLocation]
    location: SourceLocation

    def plain(self) -> dict[str, Any]:
        """Returns a Python dict of plain values."""
        return {key: value.plain() for key, value in self.entries.items()}

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)


Node = Union[Scalar, Sequence, Mapping]  # noqa: UP007 - the classes above refer to it by name


def kind_of(node: Node) -> str:
    """Returns a description of a value's type for messages."""
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


def load(path: Path, faults: FaultList) -> Node:
    """Reads a YAML file.

    Args:
        path: Path of the file.
        faults: Receives faults of single values: duplicate keys, keys that are not text, and unsupported tags.

    Raises:
        TaskFault: The file cannot be read, is empty, is not valid YAML, or is nested too deeply.
    """
    start = SourceLocation(str(path), 1, 1)
    try:
        text = read_text(path)
    except FileNotFoundError as error:
        yaml_names = sorted(file.name for file in path.parent.glob("*.yaml"))
        raise TaskFault(
            [
                Fault(
                    start,
                    f"there is no such file; {listing(yaml_names, 'no other .yaml is in its folder')}"
                    f"{nearest(path.name, yaml_names)}",
                )
            ]
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise TaskFault([Fault(start, f"the file cannot be read: {error}")]) from error
    return loads(text, str(path), faults)


def loads(text: str, file: str, faults: FaultList) -> Node:
    """Reads YAML from text, see ``load``.

    Args:
        text: YAML text.
        file: File name for messages.
        faults: Receives faults of single values.
    """
    try:
        return _Reader(text, file, faults).read()
    except yaml.MarkedYAMLError as error:
        raise TaskFault([_syntax_fault(error, text, file)]) from error
    except yaml.reader.ReaderError as error:
        raise TaskFault(
            [Fault(_location_of(text, file, error.position), f"this is not valid YAML: {error.reason}")]
        ) from error
    except (UnicodeEncodeError, yaml.YAMLError) as error:
        first_line = (str(error).splitlines() or [""])[0]
        raise TaskFault([Fault(SourceLocation(file, 1, 1), f"this is not valid YAML: {first_line}")]) from error


def _syntax_fault(error: yaml.MarkedYAMLError, text: str, file: str) -> Fault:
    problem_mark, context_mark = error.problem_mark or error.context_mark, error.context_mark
    location = (
        SourceLocation(file, problem_mark.line + 1, problem_mark.column + 1)
        if problem_mark
        else SourceLocation(file, 1, 1)
    )
    context = f" {error.context}" if error.context else ""
    if context_mark and context_mark.line + 1 != location.line:
        context += f" that begins in line {context_mark.line + 1}"
    lines = text.splitlines()
    remainder = lines[location.line - 1][location.column - 1 :] if location.line <= len(lines) else ""
    hint = "; a tab is here: indent with spaces" if remainder.startswith("\t") else ""
    return Fault(location, f"this is not valid YAML: {error.problem}{context}{hint}")


def _location_of(text: str, file: str, position: int) -> SourceLocation:
    before = text[:position]
    return SourceLocation(file, before.count("\n") + 1, position - (before.rfind("\n") + 1) + 1)


class _Reader:
    """Builds the tree from parser events, so that deep nesting is detected before the stack overflows."""

    def __init__(self, text: str, file: str, faults: FaultList) -> None:
        self._events = yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        self._file = file
        self._faults = faults
        self._count = 0
        self._depth = 0
        self._anchors: dict[str, tuple[Node, int]] = {}
        self._anchors_in_progress: set[str] = set()

    def read(self) -> Node:
        """Returns the single document of the file."""
        root: Node | None = None
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    raise TaskFault(
                        [
                            Fault(
                                self._location(event),
                                "the file has a second document; only one is allowed, remove the '---'",
                            )
                        ]
                    )
                root = self._node(next(self._events))
        if root is None:
            raise TaskFault(
                [
                    Fault(
                        SourceLocation(self._file, 1, 1),
                        "the file is empty; a task needs name, source, outcomes and states",
                    )
                ]
            )
        return root

    def _location(self, event: Any) -> SourceLocation:
        return SourceLocation(self._file, event.start_mark.line + 1, event.start_mark.column + 1)

    def _node(self, event: Any) -> Node:
        location = self._location(event)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event.anchor, location)
        count_before = self._count
        self._count_values(1, location)
        if event.anchor:
            self._anchors_in_progress.add(event.anchor)
        is_scalar = isinstance(event, yaml.ScalarEvent)
        node: Node = self._scalar(event, location) if is_scalar else self._collection(event, location)
        if event.anchor:
            self._anchors_in_progress.discard(event.anchor)
            self._anchors[event.anchor] = node, self._count - count_before
        return node

    def _count_values(self, count: int, location: SourceLocation) -> None:
        self._count += count
        if self._count > MAX_NODES:
            raise TaskFault([Fault(location, f"the file has more than {MAX_NODES} values once aliases are expanded")])

    def _alias(self, name: str, location: SourceLocation) -> Node:
        if name in self._anchors_in_progress:
            raise TaskFault([Fault(location, "this value contains itself through an alias")])
        if name not in self._anchors:
            reason = f"this is not valid YAML: the alias '*{name}' refers to no anchor before it"
            raise TaskFault([Fault(location, reason)])
        node, count = self._anchors[name]
        self._count_values(count, location)
        return node

    def _collection(self, event: Any, location: SourceLocation) -> Node:
        is_list = isinstance(event, yaml.SequenceStartEvent)
        if event.tag not in (None, "!", _TAG + ("seq" if is_list else "map")):
            self._faults.add(location, f"the tag {event.tag} cannot be used here")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise TaskFault([Fault(location, f"the file is nested more than {MAX_DEPTH} levels deep")])
        node = self._list(location) if is_list else self._mapping(location)
        self._depth -= 1
        return node

    def _list(self, location: SourceLocation) -> Sequence:
        items: list[Node] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            items.append(self._node(event))
        return Sequence(tuple(items), location)

    def _scalar(self, event: Any, location: SourceLocation) -> Scalar:
        text, tag = event.value, event.tag
        if tag in ("!", _TAG + "str") or (tag is None and not event.implicit[0]):
            return Scalar(text, location)
        for kind, pattern, convert in _CORE:
            if tag in (None, _TAG + kind) and pattern.fullmatch(text):
                try:
                    return Scalar(convert(text), location)
                except ValueError as error:
                    self._faults.add(location, f"the number '{text[:20]}...' cannot be read: {error}")
                    return Scalar(None, location)
        if tag is not None:
            self._faults.add(location, f"the tag or value '{text}' of type {tag} cannot be used here")
        return Scalar(text if tag is None else None, location)

    def _mapping(self, location: SourceLocation) -> Mapping:
        entries: dict[str, Node] = {}
        keys: dict[str, SourceLocation] = {}
        merged: list[Mapping] = []
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            key_location = self._location(event)
            is_merge = isinstance(event, yaml.ScalarEvent) and event.value == _MERGE_KEY and event.implicit[0]
            key = None if is_merge else self._key(self._node(event))
            value = self._node(next(self._events))
            if is_merge:
                merged += self._merged_mappings(value)
            elif key in entries:
                self._faults.add(
                    key_location, f"the key '{key}' is given twice; first in line {keys[key].line}; remove one of them"
                )
            elif key is not None:
                entries[key], keys[key] = value, key_location
        for other in merged:
            for key in other:
                if key not in entries:
                    entries[key], keys[key] = other.entries[key], other.keys[key]
        return Mapping(entries, keys, location)

    def _merged_mappings(self, value: Node) -> list[Mapping]:
        items = list(value.items) if isinstance(value, Sequence) else [value]
        mappings = [item for item in items if isinstance(item, Mapping)]
        if len(mappings) != len(items):
            self._faults.add(value.location, f"'<<' takes a mapping or a list of mappings, found {kind_of(value)}")
        return mappings

    def _key(self, value: Node) -> str | None:
        if isinstance(value, Scalar) and isinstance(value.value, str) and value.value:
            return value.value
        advice = "put it in quotes"
        if isinstance(value, Scalar) and isinstance(value.value, bool):
            names = "on and yes" if value.value else "off and no"
            advice = f"PyYAML writes this for the keys {names}; write the original key in quotes"
        self._faults.add(value.location, f"a key must be text, found {kind_of(value)}; {advice}")
        return None
