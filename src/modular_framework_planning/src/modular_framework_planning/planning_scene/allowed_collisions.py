# SPDX-License-Identifier: BSD-3-Clause
"""The allowed collision matrix: explicit entries for pairs of bodies, and defaults of single bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

from modular_framework_urdf.srdf_reader import SemanticDescription


@dataclass(frozen=True)
class AllowedCollisionMatrix:
    """Verdicts whether two bodies may touch; a pair without an entry falls back to the defaults of its bodies.

    Attributes:
        entries: Verdict for each pair of body names, in either order.
        defaults: Verdict for each body name, for pairs without an entry.
        names: Names of the listed bodies, in the order of the message.
    """

    entries: Mapping[frozenset[str], bool] = field(default_factory=dict)
    defaults: Mapping[str, bool] = field(default_factory=dict)
    names: tuple[str, ...] = ()

    @cached_property
    def verdicts(self) -> tuple[frozenset[tuple[frozenset[str], bool]], frozenset[tuple[str, bool]]]:
        """Entries and defaults as hashable sets."""
        return frozenset(self.entries.items()), frozenset(self.defaults.items())

    @cached_property
    def entry_names(self) -> frozenset[str]:
        """Names of bodies with an entry or a default; `allows_others` applies to all other bodies."""
        return frozenset(chain(chain.from_iterable(self.entries), self.defaults))

    def allows(self, first: str, second: str) -> bool:
        """Returns whether two bodies may touch; if both have defaults, both defaults must allow contact."""
        entry = self.entries.get(frozenset((first, second)))
        return _default(self.defaults, first, second) if entry is None else entry

    def allows_others(self, name: str) -> bool:
        """Returns whether a body may touch bodies that the matrix does not name."""
        return self.defaults.get(name, False)

    def with_entry(self, first: str, second: str, allowed: bool) -> AllowedCollisionMatrix:
        """Returns a copy of the matrix with one entry set.

        Args:
            first: Name of a body.
            second: Name of the other body.
            allowed: Whether the bodies may touch.
        """
        entries = dict(self.entries)
        entries[frozenset((first, second))] = allowed
        names = self.names + tuple(name for name in dict.fromkeys((first, second)) if name not in self.names)
        return replace(self, entries=entries, names=names)

    def with_defaults(self, defaults: Mapping[str, bool]) -> AllowedCollisionMatrix:
        """Returns a copy of the matrix with the given defaults set."""
        names = self.names + tuple(name for name in defaults if name not in self.names)
        return replace(self, defaults={**self.defaults, **defaults}, names=names)

    def as_rows(self) -> list[list[bool]]:
        """Returns the square matrix of allowed collisions over `names`, including defaults, as in the ROS message."""
        return [[self.allows(row, column) for column in self.names] for row in self.names]


def _default(defaults: Mapping[str, bool], first: str, second: str) -> bool:
    if not defaults:
        return False
    verdicts = [defaults[name] for name in (first, second) if name in defaults]
    return bool(verdicts) and all(verdicts)


def matrix_from_semantics(semantics: SemanticDescription, links: Sequence[str]) -> AllowedCollisionMatrix:
    """Builds the initial matrix of a robot from its SRDF.

    As in MoveIt, links with disabled default collisions may touch everything by default; enabled pairs override these
    defaults, and disabled pairs override enabled pairs. Unknown names are ignored.
    """
    known = frozenset(links)
    entries = {
        pair: verdict
        for pairs, verdict in ((semantics.enabled_pairs, False), (semantics.disabled_pairs, True))
        for pair in pairs
        if len(pair) == 2 and pair <= known
    }
    defaults = {link: True for link in semantics.touching_links if link in known}
    return AllowedCollisionMatrix(entries, defaults, tuple(links))


def matrix_from_rows(
    names: Sequence[str], rows: Sequence[Sequence[bool]], defaults: Mapping[str, bool]
) -> AllowedCollisionMatrix:
    """Builds a matrix from the upper triangle of its square form.

    Verdicts equal to the defaults become no entries, so that a matrix that is read and sent back keeps its meaning when
    defaults change. Bodies with a default are included.

    Args:
        names: Names of the bodies.
        rows: Whether each pair of bodies may touch, a square matrix.
        defaults: Default of each body.

    Raises:
        ValueError: The matrix is not square, or a name occurs twice.
    """
    if len(rows) != len(names) or any(len(row) != len(names) for row in rows):
        raise ValueError(
            f"allowed_collision_matrix: {len(names)} names, but rows have lengths {[len(row) for row in rows]}; "
            "send a square matrix with one row and one column per name"
        )
    if len(set(names)) != len(names):
        raise ValueError("allowed_collision_matrix: entry_names contains a name twice; list each body once")
    index_of = {name: index for index, name in enumerate(names)}
    entries: dict[frozenset[str], bool] = {}
    for index, name in enumerate(names):
        for other in names[index:]:
            verdict = bool(rows[index][index_of[other]])
            if verdict != _default(defaults, name, other):
                entries[frozenset((name, other))] = verdict
    return AllowedCollisionMatrix(entries, dict(defaults), tuple(dict.fromkeys((*names, *defaults))))
