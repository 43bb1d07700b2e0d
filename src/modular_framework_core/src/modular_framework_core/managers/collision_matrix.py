# SPDX-License-Identifier: BSD-3-Clause
"""The allowed collision matrix: pairs of links and objects that may touch."""

from __future__ import annotations

from dataclasses import dataclass


class AcmError(ValueError):
    """A request for the allowed collision matrix is invalid."""


@dataclass(frozen=True, slots=True)
class CollisionMatrix:
    """A symmetric matrix of pairs that may touch.

    Attributes:
        names: Links and objects of the rows and columns.
        rows: ``rows[i][j]`` is True if ``names[i]`` may touch ``names[j]``.
        default_names: Links and objects with a default for pairs outside of the matrix.
        default_values: Defaults of ``default_names``.
    """

    names: tuple[str, ...]
    rows: tuple[tuple[bool, ...], ...]
    default_names: tuple[str, ...] = ()
    default_values: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        """Checks that the matrix is square and that every default name has a value."""
        size = len(self.names)
        widths = {len(row) for row in self.rows}
        if len(self.rows) != size or (size and widths != {size}):
            raise AcmError(
                f"The collision matrix names {size} entries but has {len(self.rows)} rows of widths "
                f"{sorted(widths)}; it must be square."
            )
        if len(set(self.names)) != size:
            raise AcmError("The collision matrix names an entry twice; every name must be unique.")
        if len(self.default_names) != len(self.default_values):
            raise AcmError(
                f"The collision matrix has {len(self.default_names)} default names but "
                f"{len(self.default_values)} default values."
            )

    def is_allowed(self, first: str, second: str) -> bool | None:
        """Returns whether a pair may touch, or None if the matrix does not contain both names."""
        if first not in self.names or second not in self.names:
            return None
        return self.rows[self.names.index(first)][self.names.index(second)]


@dataclass(slots=True)
class MutableMatrix:
    """A mutable copy of a collision matrix."""

    names: list[str]
    rows: list[list[bool]]

    @classmethod
    def of(cls, matrix: CollisionMatrix) -> MutableMatrix:
        """Copies a matrix."""
        return cls(list(matrix.names), [list(row) for row in matrix.rows])

    def add(self, name: str) -> None:
        """Adds an entry without allowed collisions, except with itself."""
        for row in self.rows:
            row.append(False)
        self.names.append(name)
        self.rows.append([False] * (len(self.names) - 1) + [True])

    def delete(self, name: str) -> None:
        """Removes an entry."""
        index = self.names.index(name)
        del self.names[index], self.rows[index]
        for row in self.rows:
            del row[index]

    def set(self, first: str, second: str, value: bool) -> None:
        """Sets whether a pair may touch.

        Args:
            first: Name of one link or object.
            second: Name of the other.
            value: Whether they may touch.
        """
        i, j = self.names.index(first), self.names.index(second)
        self.rows[i][j] = self.rows[j][i] = value
