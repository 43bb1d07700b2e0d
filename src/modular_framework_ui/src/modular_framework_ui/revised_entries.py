# SPDX-License-Identifier: BSD-3-Clause
"""Bounded list that returns the entries changed since a revision, so that a page receives each change once."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Generic, TypeVar

Entry = TypeVar("Entry")


class RevisedEntries(Generic[Entry]):
    """Entries with consecutive indices and the revision of their last change. Indices are never reused.

    Args:
        max_entries: Maximum number of entries; a new entry replaces the oldest entry of a full list.
    """

    def __init__(self, max_entries: int) -> None:
        self._max_entries = max_entries
        self._entries: dict[int, Entry] = {}
        self._revisions: dict[int, int] = {}
        self._next = 0

    @property
    def oldest(self) -> int:
        """Returns the index of the oldest entry, or the next index if there is no entry."""
        return next(iter(self._entries), self._next)

    def add(self, entry: Entry, revision: int) -> None:
        """Appends an entry.

        Args:
            entry: New entry.
            revision: Revision of the change.
        """
        self.set(self._next, entry, revision)
        self._next += 1
        if len(self._entries) > self._max_entries:
            oldest = self.oldest
            del self._entries[oldest], self._revisions[oldest]

    def set(self, index: int, entry: Entry, revision: int) -> None:
        """Replaces an entry.

        Args:
            index: Index of the entry.
            entry: New value.
            revision: Revision of the change.
        """
        self._entries[index], self._revisions[index] = entry, revision

    def clear(self) -> None:
        """Removes all entries."""
        self._entries.clear()
        self._revisions.clear()

    def items(self) -> list[tuple[int, Entry]]:
        """Returns all entries with their indices, oldest first."""
        return list(self._entries.items())

    def newest_first(self) -> Iterator[tuple[int, Entry]]:
        """Yields all entries with their indices, newest first."""
        yield from reversed(self._entries.items())

    def added_since(self, revision: int) -> dict[int, Entry]:
        """Returns the entries that were added after a revision, keyed by index; for entries that never change."""
        new = itertools.takewhile(lambda item: self._revisions[item[0]] > revision, self.newest_first())
        return dict(reversed(list(new)))

    def changed_since(self, revision: int) -> dict[int, Entry]:
        """Returns the entries that changed after a revision, keyed by index."""
        return {index: entry for index, entry in self._entries.items() if self._revisions[index] > revision}
