# SPDX-License-Identifier: BSD-3-Clause
"""The allowed collision matrix: explicit entries for pairs of bodies first, then defaults of single bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

from modular_framework_urdf.srdf_reader import SemanticDescription


@dataclass(frozen=True)
class AllowedCollisionMatrix:
    """Pairs of body names to "may touch"; a pair without an entry falls back to the defaults of its two bodies.

    Attributes:
        entries: explicit verdicts, order of names does not matter.
        defaults: verdict for every pair of a body without an explicit entry.
        names: bodies listed, in the order of the message (kept for the answer on the wire).
    """

    entries: Mapping[frozenset[str], bool] = field(default_factory=dict)
    defaults: Mapping[str, bool] = field(default_factory=dict)
    names: tuple[str, ...] = ()

    @cached_property
    def verdicts(self) -> tuple[frozenset[tuple[frozenset[str], bool]], frozenset[tuple[str, bool]]]:
        """Entries and defaults, hashable."""
        return frozenset(self.entries.items()), frozenset(self.defaults.items())

    @cached_property
    def named(self) -> frozenset[str]:
        """Bodies with an entry or a default; all others may touch the same ones, see allows_others."""
        return frozenset(chain(chain.from_iterable(self.entries), self.defaults))

    def allows(self, first: str, second: str) -> bool:
        """Whether the two bodies may touch; when both have a default, both must allow it."""
        entry = self.entries.get(frozenset((first, second)))
        return _default(self.defaults, first, second) if entry is None else entry

    def allows_others(self, name: str) -> bool:
        """Whether a body may touch those that the matrix does not name."""
        return self.defaults.get(name, False)

    def with_entry(self, first: str, second: str, allowed: bool) -> AllowedCollisionMatrix:
        """Returns a matrix in which one pair has the given verdict."""
        entries = dict(self.entries)
        entries[frozenset((first, second))] = allowed
        names = self.names + tuple(name for name in dict.fromkeys((first, second)) if name not in self.names)
        return replace(self, entries=entries, names=names)

    def with_defaults(self, defaults: Mapping[str, bool]) -> AllowedCollisionMatrix:
        """Returns a matrix in which the named bodies have the given default verdicts."""
        names = self.names + tuple(name for name in defaults if name not in self.names)
        return replace(self, defaults={**self.defaults, **defaults}, names=names)

    def as_rows(self) -> list[list[bool]]:
        """Returns the square matrix of verdicts over `names`, defaults applied, as the message wants it."""
        return [[self.allows(row, column) for column in self.names] for row in self.names]


def _default(defaults: Mapping[str, bool], first: str, second: str) -> bool:
    if not defaults:
        return False
    verdicts = [defaults[name] for name in (first, second) if name in defaults]
    return bool(verdicts) and all(verdicts)


def matrix_from_semantics(semantics: SemanticDescription, links: Sequence[str]) -> AllowedCollisionMatrix:
    """Builds the matrix a robot begins with; every link is named.

    As in MoveIt: links with disabled default collisions may touch anything by default, then enabled pairs are entered,
    and disabled pairs last. Names the robot does not have mean nothing.
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
    """Builds a matrix from its square form, of which the upper triangle counts.

    A verdict that is that of the defaults is no entry: it changes with them, and a matrix that was read, and sent back
    unchanged, means the same. Bodies with a default are named too.

    Raises:
        ValueError: the matrix is not square, or a name stands twice.
    """
    if len(rows) != len(names) or any(len(row) != len(names) for row in rows):
        raise ValueError(
            f"allowed_collision_matrix: {len(names)} names but rows of {[len(row) for row in rows]}; "
            "one row per name and one value per name in each row are needed"
        )
    if len(set(names)) != len(names):
        raise ValueError("allowed_collision_matrix: a name stands twice in entry_names; list each body once")
    index_of = {name: number for number, name in enumerate(names)}
    entries: dict[frozenset[str], bool] = {}
    for index, name in enumerate(names):
        for other in names[index:]:
            verdict = bool(rows[index][index_of[other]])
            if verdict != _default(defaults, name, other):
                entries[frozenset((name, other))] = verdict
    return AllowedCollisionMatrix(entries, dict(defaults), tuple(dict.fromkeys((*names, *defaults))))
