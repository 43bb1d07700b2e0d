# SPDX-License-Identifier: BSD-3-Clause
"""Readers of single values of an experiment file: each returns the value, or adds a fault and returns None."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.resource_lookup import ResourceLookup
from modular_framework_core.files.faults import FaultList, FileFaults, TaskFault
from modular_framework_core.files.located_yaml import Mapping, Node, Scalar, Sequence, kind_of

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
MAX_SEED = 2**31 - 1


class ExperimentFault(FileFaults):
    """An experiment file is invalid."""

    kind = "experiment"

    @classmethod
    def of(cls, error: TaskFault) -> ExperimentFault:
        """Returns the fault of a file that is not valid YAML."""
        return cls(error.faults)


@dataclass(frozen=True, slots=True)
class ValueReading:
    """Reader of values that refer to nothing outside the file.

    Attributes:
        faults: Collected faults.
    """

    faults: FaultList

    def text(self, node: Node, what: str) -> str | None:
        """Returns a nonempty text."""
        if isinstance(node, Scalar) and isinstance(node.value, str) and node.value:
            return node.value
        self.faults.add(node.location, f"{what} must be a text, found {kind_of(node)}")
        return None

    def optional_text(self, node: Node, what: str) -> str | None:
        """Returns a text, which may be empty."""
        return "" if isinstance(node, Scalar) and node.value == "" else self.text(node, what)

    def name(self, node: Node, what: str) -> str | None:
        """Returns a text that is valid as a file name and as a database column."""
        name = self.text(node, what)
        if name is None or _NAME.fullmatch(name):
            return name
        self.faults.add(node.location, f"{what} '{name}' must be letters, digits, _ and -, and start with a letter")
        return None

    def choice(self, node: Node, what: str, allowed: Collection[str]) -> str | None:
        """Returns one of the allowed texts.

        Args:
            node: Value of the file.
            what: Name of the value in fault messages.
            allowed: Allowed texts.
        """
        text = self.text(node, what)
        if text is None or text in allowed:
            return text
        self.faults.add_unknown(node.location, what, text, allowed)
        return None

    def truth(self, node: Node, what: str) -> bool | None:
        """Returns a truth value."""
        if isinstance(node, Scalar) and isinstance(node.value, bool):
            return node.value
        self.faults.add(node.location, f"{what} must be true or false, found {kind_of(node)}")
        return None

    def number(self, node: Node, what: str, low: float = -math.inf, high: float = math.inf) -> float | None:
        """Returns a finite number of a closed range.

        Args:
            node: Value of the file.
            what: Name of the value in fault messages.
            low: Smallest allowed number.
            high: Largest allowed number.
        """
        value = node.value if isinstance(node, Scalar) else None
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if is_number and math.isfinite(value) and low <= value <= high:  # type: ignore[arg-type, operator]
            return float(value)  # type: ignore[arg-type]
        self.faults.add(node.location, f"{what} must be {_range_text('a number', low, high)}, found {kind_of(node)}")
        return None

    def seconds(self, node: Node, what: str) -> float | None:
        """Returns a duration [s]."""
        return self.number(node, f"{what} [s]", 0.001, 1e6)

    def count(self, node: Node, what: str, low: int = 1, high: int = MAX_SEED) -> int | None:
        """Returns an integer of a closed range.

        Args:
            node: Value of the file.
            what: Name of the value in fault messages.
            low: Smallest allowed number.
            high: Largest allowed number.
        """
        value = node.value if isinstance(node, Scalar) else None
        if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high:
            return value
        self.faults.add(
            node.location, f"{what} must be {_range_text('a whole number', low, high)}, found {kind_of(node)}"
        )
        return None

    def items(self, node: Node, what: str, example: str) -> tuple[Node, ...] | None:
        """Returns the items of a nonempty list.

        Args:
            node: Value of the file.
            what: Name of the value in fault messages.
            example: Example for fault messages.
        """
        if isinstance(node, Sequence) and node.items:
            return node.items
        found_text = "an empty list" if isinstance(node, Sequence) else kind_of(node)
        self.faults.add(node.location, f"{what} must be a list such as {example}, found {found_text}")
        return None

    def mapping(self, node: Node, what: str, example: str) -> Mapping | None:
        """Returns a mapping; an empty value counts as an empty mapping.

        Args:
            node: Value of the file.
            what: Name of the value in fault messages.
            example: Example for fault messages.
        """
        if isinstance(node, Mapping):
            return node
        if isinstance(node, Scalar) and node.value is None:
            return Mapping({}, {}, node.location)
        self.faults.add(node.location, f"{what} must be a mapping such as {example}, found {kind_of(node)}")
        return None


@dataclass(frozen=True, slots=True)
class Reading(ValueReading):
    """Reader of values that may refer to files and packages.

    Attributes:
        folder: Folder of the experiment file, the base of relative paths.
        resources: Lookup of launch files, tasks, models and packages.
    """

    folder: Path
    resources: ResourceLookup

    def path(self, text: str) -> Path:
        """Returns an absolute path: relative paths start at the file's folder, `~` is the home folder."""
        return (self.folder / Path(text).expanduser()).resolve()


def json_value(node: Node) -> Any:
    """Returns a value in the form of the parameter server and of JSON."""
    return node.plain()


def _range_text(what: str, low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return what
    if math.isinf(high):
        return f"{what} of at least {low:g}"
    return f"{what} from {low:g} to {high:g}"
