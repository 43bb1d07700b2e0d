# SPDX-License-Identifier: BSD-3-Clause
"""Collects the faults of a file, each with location and remedy, and raises them together."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass

from modular_framework_ros.allowed_names import listing, nearest


@dataclass(frozen=True, slots=True, order=True)
class SourceLocation:
    """A position in a file.

    Attributes:
        file: Path of the file as the user gave it.
        line: Line number, from 1.
        column: Column number, from 1.
    """

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True, order=True)
class Fault:
    """A fault in a file."""

    location: SourceLocation
    message: str

    def __str__(self) -> str:
        return f"{self.location}: {self.message}"


class FileFaults(Exception):
    """A file is invalid; the exception carries all of its faults.

    Attributes:
        kind: Noun for the content of the file, used in the message.
        faults: Faults in file order.
    """

    kind = "file"

    def __init__(self, faults: Iterable[Fault]) -> None:
        """Sorts the faults by location and drops duplicates."""
        self.faults: tuple[Fault, ...] = tuple(sorted(set(faults)))
        lines = "\n".join(f"  {fault}" for fault in self.faults)
        count = f"{len(self.faults)} faults" if len(self.faults) != 1 else "1 fault"
        super().__init__(f"{count} in the {self.kind}:\n{lines}")


class TaskFault(FileFaults):
    """A task file is invalid."""

    kind = "task"


class FaultList:
    """Collects the faults of one file."""

    def __init__(self) -> None:
        self._faults: list[Fault] = []
        self._explained: set[SourceLocation] = set()
        self.harmless = 0
        """Number of faults that do not affect the known states and userdata of the task."""

    def add(self, location: SourceLocation, message: str) -> None:
        """Adds a fault, except at the location of a fault added by ``add_cause``, which is the cause."""
        if location not in self._explained:
            self._faults.append(Fault(location, message))

    def add_cause(self, location: SourceLocation, message: str) -> None:
        """Adds a fault of an unreadable value and hides later faults of that value."""
        self.add(location, message)
        self._explained.add(location)

    def add_unknown(
        self, location: SourceLocation, noun: str, found_text: str, allowed: Iterable[str], used: Container[str] = ()
    ) -> None:
        """Adds a fault for an unknown name, with a similar allowed name as a suggestion.

        Args:
            location: Position of the name.
            noun: Noun phrase for the name, such as ``outcome``.
            found_text: Unknown name.
            allowed: Allowed names.
            used: Names that are already used in the same mapping, and are therefore not suggested.
        """
        names = list(dict.fromkeys(allowed))
        unused = [name for name in names if name not in used]
        self.add(location, f"{noun} '{found_text}' is unknown; {listing(names)}{nearest(found_text, unused)}")

    def extend(self, other: FaultList) -> None:
        """Adds the faults of another list."""
        for fault in other._faults:
            self.add(fault.location, fault.message)

    def sorted_faults(self) -> tuple[Fault, ...]:
        """Returns the distinct faults, sorted by location."""
        return tuple(sorted(set(self._faults)))

    def __len__(self) -> int:
        return len(self._faults)

    def raise_if_any(self) -> None:
        """Raises ``TaskFault`` with all faults, if any."""
        if self._faults:
            raise TaskFault(self._faults)
