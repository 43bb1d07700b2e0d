# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML files entry by entry with line numbers, so that one bad entry is reported and the others are used."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from modular_framework_core.files import shallow_yaml
from modular_framework_core.files.atomic_files import read_text

_NODES = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # entries read the text of a value: its tag is not needed


class EntryError(ValueError):
    """One entry of a configuration file cannot be used.

    Args:
        path: File that holds the entry.
        line: Line of the fault, counted from 1.
        text: What was found, what is allowed and what to do.
    """

    def __init__(self, path: Path, line: int, text: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {text}")


@dataclass(frozen=True, slots=True)
class Entry:
    """A key with its still untyped YAML node.

    Attributes:
        path: File of the entry.
        line: Line of the key, counted from 1.
        key: Text of the key.
        node: YAML node of the value.
    """

    path: Path
    line: int
    key: str
    node: yaml.Node

    def fault(self, text: str) -> EntryError:
        """Makes an error that points at this entry."""
        return EntryError(self.path, self.line, f"'{self.key}': {text}")

    def children(self) -> list[Entry]:
        """Splits a mapping into its entries.

        Raises:
            EntryError: The value is no mapping, or a key occurs twice.
        """
        if not isinstance(self.node, yaml.MappingNode):
            raise self.fault(f"got {describe(self.node)}, expected a mapping of keys to values")
        entries: list[Entry] = []
        seen: set[str] = set()
        for key_node, value_node in self.node.value:
            entry = Entry(self.path, int(key_node.start_mark.line) + 1, str(key_node.value), value_node)
            if entry.key in seen:
                raise entry.fault(f"the key occurs twice in '{self.key}'; keep one of them")
            seen.add(entry.key)
            entries.append(entry)
        return entries

    def items(self) -> list[Entry]:
        """Splits a list into entries whose keys are the positions counted from 1.

        Raises:
            EntryError: The value is no list.
        """
        if not isinstance(self.node, yaml.SequenceNode):
            raise self.fault(f"got {describe(self.node)}, expected a list")
        return [
            Entry(self.path, int(node.start_mark.line) + 1, f"{self.key}[{number}]", node)
            for number, node in enumerate(self.node.value, start=1)
        ]

    def number(self) -> float:
        """Reads the value as a finite number in double precision.

        Raises:
            EntryError: The value is no finite number.
        """
        text = self.text()
        if isinstance(self.node, yaml.ScalarNode) and not self.node.style:  # plain: None, or "" from libyaml
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if math.isfinite(value):
                return value
        raise self.fault(f"got {describe(self.node)}, expected a finite number")

    def text(self) -> str:
        """Reads the value as text.

        Raises:
            EntryError: The value is a mapping or a list.
        """
        if not isinstance(self.node, yaml.ScalarNode):
            raise self.fault(f"got {describe(self.node)}, expected a single value")
        return str(self.node.value)


def describe(node: yaml.Node) -> str:
    """Names a YAML node for an error text."""
    match node:
        case yaml.MappingNode():
            return "a mapping"
        case yaml.SequenceNode():
            return "a list"
        case _:
            return f"'{node.value}'" if node.value else "nothing"


def read_entries(path: Path) -> Iterator[Entry | EntryError]:
    """Reads the top-level mapping of a YAML file.

    Args:
        path: File to read; an empty file has no entries.

    Yields:
        Each entry in file order, or an error for an entry that repeats an earlier key.

    Raises:
        EntryError: The file cannot be read, is no YAML, or its top level is no mapping.
    """
    try:
        root = shallow_yaml.compose(read_text(path), _NODES)
    except (OSError, UnicodeDecodeError) as error:
        raise EntryError(path, 1, f"cannot be read ({error}); give the path of a readable YAML file") from error
    except yaml.MarkedYAMLError as error:
        line = int(error.problem_mark.line) + 1 if error.problem_mark else 1
        raise EntryError(path, line, f"is no valid YAML: {error.problem}; correct this line") from error
    except yaml.YAMLError as error:
        raise EntryError(path, 1, f"is no valid YAML: {error}") from error
    if root is None:
        return
    if not isinstance(root, yaml.MappingNode):
        raise EntryError(path, 1, f"the top level is {describe(root)}, expected a mapping of names to entries")
    seen: set[str] = set()
    for key_node, value_node in root.value:
        entry = Entry(path, int(key_node.start_mark.line) + 1, str(key_node.value), value_node)
        if entry.key in seen:
            yield entry.fault("this name was used further up in the file; rename one of the two")
            continue
        seen.add(entry.key)
        yield entry


def name_fault(name: str) -> str:
    """Describes why a name cannot be sent in a message; "" if it can."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return f"the name {name!r} has half of a character (a lone surrogate); leave it out"
    return "" if name else "the name is empty; write one"


def read_each_entry(path: Path, handle: Callable[[Entry], None]) -> list[EntryError]:
    """Calls a function with every entry of a file, and continues after one that is not usable.

    Args:
        path: File to read.
        handle: Gets one entry after the other; raises EntryError for one it cannot use.

    Returns:
        One error for each entry (or for the file) that is not usable, in file order.
    """
    faults: list[EntryError] = []
    try:
        for entry in read_entries(path):
            try:
                if isinstance(entry, EntryError):
                    raise entry
                if fault := name_fault(entry.key):
                    raise EntryError(entry.path, entry.line, fault)
                handle(entry)
            except EntryError as error:
                faults.append(error)
    except EntryError as error:
        faults.append(error)
    return faults
