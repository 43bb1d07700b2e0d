# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML files entry by entry with line numbers, so that one invalid entry does not affect the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import yaml

from modular_framework_core.files import shallow_yaml
from modular_framework_core.files.atomic_files import read_text

_NODE_LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # values stay text; each entry converts its values
Parsed = TypeVar("Parsed")


class EntryError(ValueError):
    """An entry of a configuration file is invalid.

    Args:
        path: File of the entry.
        line: Line of the fault, from 1.
        text: Message with the found value, the allowed values and the remedy.
    """

    def __init__(self, path: Path, line: int, text: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {text}")


@dataclass(frozen=True, slots=True)
class Entry:
    """A key with its unconverted YAML node.

    Attributes:
        path: File of the entry.
        line: Line of the key, from 1.
        key: Text of the key.
        node: YAML node of the value.
    """

    path: Path
    line: int
    key: str
    node: yaml.Node

    def fault(self, text: str) -> EntryError:
        """Returns an error located at this entry."""
        return EntryError(self.path, self.line, f"'{self.key}': {text}")

    def children(self) -> list[Entry]:
        """Returns the entries of a mapping.

        Raises:
            EntryError: The value is not a mapping, or a key occurs twice.
        """
        if not isinstance(self.node, yaml.MappingNode):
            raise self.fault(f"got {describe(self.node)}, expected a mapping of keys to values")
        entries: list[Entry] = []
        seen_keys: set[str] = set()
        for key_node, value_node in self.node.value:
            entry = Entry(self.path, int(key_node.start_mark.line) + 1, str(key_node.value), value_node)
            if entry.key in seen_keys:
                raise entry.fault(f"the key occurs twice in '{self.key}'; keep one of them")
            seen_keys.add(entry.key)
            entries.append(entry)
        return entries

    def items(self) -> list[Entry]:
        """Returns the items of a list as entries ``key[1]``, ``key[2]``, ...

        Raises:
            EntryError: The value is not a list.
        """
        if not isinstance(self.node, yaml.SequenceNode):
            raise self.fault(f"got {describe(self.node)}, expected a list")
        return [
            Entry(self.path, int(node.start_mark.line) + 1, f"{self.key}[{index}]", node)
            for index, node in enumerate(self.node.value, start=1)
        ]

    def number(self) -> float:
        """Returns the value as a finite number in double precision.

        Raises:
            EntryError: The value is not a finite number.
        """
        text = self.text()
        if isinstance(self.node, yaml.ScalarNode) and not self.node.style:  # style of plain scalars: None or ""
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if math.isfinite(value):
                return value
        raise self.fault(f"got {describe(self.node)}, expected a finite number")

    def text(self) -> str:
        """Returns the value as text.

        Raises:
            EntryError: The value is a mapping or a list.
        """
        if not isinstance(self.node, yaml.ScalarNode):
            raise self.fault(f"got {describe(self.node)}, expected a single value")
        return str(self.node.value)


def describe(node: yaml.Node) -> str:
    """Returns a description of a YAML node's type for messages."""
    match node:
        case yaml.MappingNode():
            return "a mapping"
        case yaml.SequenceNode():
            return "a list"
        case _:
            return f"'{node.value}'" if node.value else "nothing"


def read_entries(path: Path) -> Iterator[Entry | EntryError]:
    """Yields the entries of a file's top-level mapping.

    Args:
        path: YAML file; an empty file has no entries.

    Yields:
        Each entry in file order, or an error for an entry that repeats an earlier key.

    Raises:
        EntryError: The file cannot be read, is not valid YAML, or its top level is not a mapping.
    """
    try:
        root = shallow_yaml.compose(read_text(path), _NODE_LOADER)
    except (OSError, UnicodeDecodeError) as error:
        raise EntryError(path, 1, f"cannot be read ({error}); give the path of a readable YAML file") from error
    except yaml.MarkedYAMLError as error:
        line = int(error.problem_mark.line) + 1 if error.problem_mark else 1
        raise EntryError(path, line, f"is not valid YAML: {error.problem}; correct this line") from error
    except yaml.YAMLError as error:
        raise EntryError(path, 1, f"is not valid YAML: {error}") from error
    if root is None:
        return
    if not isinstance(root, yaml.MappingNode):
        raise EntryError(path, 1, f"the top level is {describe(root)}, expected a mapping of names to entries")
    seen_names: set[str] = set()
    for key_node, value_node in root.value:
        entry = Entry(path, int(key_node.start_mark.line) + 1, str(key_node.value), value_node)
        if entry.key in seen_names:
            yield entry.fault("this name occurs earlier in the file; rename one of the two entries")
            continue
        seen_names.add(entry.key)
        yield entry


def name_fault(name: str) -> str:
    """Returns the reason why a name cannot be sent in a ROS message; "" if valid."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return f"the name {name!r} contains half of a character (a lone surrogate); remove it"
    return "" if name else "the name is empty; write a name"


def read_each_entry(path: Path, parse: Callable[[Entry], Parsed]) -> tuple[list[Parsed], list[EntryError]]:
    """Parses every entry of a file and continues after invalid entries.

    Args:
        path: YAML file.
        parse: Function that returns the content of an entry, and raises EntryError for an invalid entry.

    Returns:
        The contents of the valid entries, and one error per invalid entry or for an unreadable file, in file order.
    """
    parsed: list[Parsed] = []
    faults: list[EntryError] = []
    try:
        for entry in read_entries(path):
            try:
                if isinstance(entry, EntryError):
                    raise entry
                if fault := name_fault(entry.key):
                    raise EntryError(entry.path, entry.line, fault)
                parsed.append(parse(entry))
            except EntryError as error:
                faults.append(error)
    except EntryError as error:
        faults.append(error)
    return parsed, faults
