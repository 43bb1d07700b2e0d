# SPDX-License-Identifier: BSD-3-Clause
"""Keeps messages of one kind so that components exchange them without knowing each other.

A message stored with a name stays until it is overwritten or removed. A message stored without a name joins a queue:
the oldest is handed out first and leaves the queue for good.
"""

from __future__ import annotations

import bisect
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

MessageT = TypeVar("MessageT")
LISTED_NAMES = 10
"""Names in the text of an error; a line of the log is written to every listener of the log."""


class Action(Enum):
    """The kind of a change of a store."""

    ADDED = 0
    REPLACED = 1
    HANDED_OUT = 2
    REMOVED = 3
    CLEARED = 4
    LOADED = 5


@dataclass(frozen=True, slots=True)
class Change:
    """One change of a store.

    Attributes:
        action: What happened.
        name: Name of the message; empty for an anonymous one, and where several messages changed.
        named: How many named messages there are after it.
        anonymous: How many anonymous messages wait after it.
    """

    action: Action
    name: str
    named: int
    anonymous: int


class MessageNotFoundError(LookupError):
    """No message answers the request; the text says what was asked for and what there is.

    Args:
        kind: Noun of the stored messages, for example ``joint state``.
        name: Name that was asked for; empty for the anonymous queue.
        known_names: Names the store does hold, sorted.
    """

    def __init__(self, kind: str, name: str, known_names: tuple[str, ...]) -> None:
        self.kind, self.name, self.known_names = kind, name, known_names
        place = max(0, bisect.bisect(known_names, name) - LISTED_NAMES // 2) if name else 0
        listed = [shown if len(shown) <= 80 else f"{shown[:80]}..." for shown in known_names[place:][:LISTED_NAMES]]
        allowed = ", ".join(listed) or "none"
        if len(listed) < len(known_names):
            allowed += f" (the nearest of {len(known_names)} in the alphabet)"
        if name:
            text = f"No {kind} named '{name}' is stored. Stored names: {allowed}. Add it first or correct the name."
        else:
            text = (
                f"No anonymous {kind} is waiting to be read: none was added, or all were handed out already. "
                f"Stored names: {allowed}. Add one, or ask by name."
            )
        super().__init__(text)


class MessageStore(Generic[MessageT]):
    """Thread-safe store of the messages of one kind.

    Args:
        kind: Noun used in error texts, for example ``grasp``.
        on_named: Called with (message, name) before a named message is stored; may complete the message in place.
        on_change: Called after each change, in the order of the changes; must not call the store.
    """

    def __init__(
        self,
        kind: str,
        on_named: Callable[[MessageT, str], None] | None = None,
        on_change: Callable[[Change], None] | None = None,
    ) -> None:
        self.kind = kind
        self._on_named = on_named
        self._on_change = on_change
        self._named: dict[str, MessageT] = {}
        self._anonymous: deque[MessageT] = deque()
        self._lock = threading.Lock()

    def add(self, message: MessageT, name: str = "") -> bool:
        """Stores a message.

        Args:
            message: What to keep.
            name: Key of the message; an empty one appends to the anonymous queue.

        Returns:
            True when a message of that name was replaced.
        """
        with self._lock:
            if not name:
                self._anonymous.append(message)
                self._changed(Action.ADDED)
                return False
            replaced = name in self._named
            self._put(message, name)
            self._changed(Action.REPLACED if replaced else Action.ADDED, name)
            return replaced

    def _put(self, message: MessageT, name: str) -> None:
        if self._on_named is not None:
            self._on_named(message, name)
        self._named[name] = message

    def _changed(self, action: Action, name: str = "") -> None:
        if self._on_change is not None:
            self._on_change(Change(action, name, len(self._named), len(self._anonymous)))

    def get(self, name: str = "") -> MessageT:
        """Hands out a message: the named one, which stays, or the oldest anonymous one, which is removed.

        Args:
            name: Key of the message; empty asks the anonymous queue.

        Returns:
            The message.

        Raises:
            MessageNotFoundError: Nothing of that name is stored, or the queue is empty.
        """
        with self._lock:
            if name and name in self._named:
                return self._named[name]
            if not name and self._anonymous:
                message = self._anonymous.popleft()
                self._changed(Action.HANDED_OUT)
                return message
            raise MessageNotFoundError(self.kind, name, tuple(sorted(self._named)))

    def remove(self, name: str) -> None:
        """Removes a named message.

        Raises:
            MessageNotFoundError: Nothing of that name is stored.
        """
        with self._lock:
            if name not in self._named:
                raise MessageNotFoundError(self.kind, name, tuple(sorted(self._named)))
            del self._named[name]
            self._changed(Action.REMOVED, name)

    def clear(self, *, named: bool = True) -> None:
        """Removes every anonymous message and, unless they are to stay, the named ones."""
        with self._lock:
            if named:
                self._named.clear()
            self._anonymous.clear()
            self._changed(Action.CLEARED)

    def contents(self) -> tuple[dict[str, MessageT], list[MessageT]]:
        """Returns the named messages and the anonymous ones, oldest first, without removing any."""
        with self._lock:
            return dict(self._named), list(self._anonymous)

    def load(self, named: Mapping[str, MessageT], anonymous: Iterable[MessageT] = (), *, clear: bool = False) -> None:
        """Stores many messages in one step; readers see all of them or none.

        Args:
            named: Messages by name; those of a name that is taken replace the older one.
            anonymous: Messages to append to the queue, oldest first.
            clear: Whether everything stored before is removed.
        """
        with self._lock:
            if clear:
                self._named.clear()
                self._anonymous.clear()
            for name, message in named.items():
                self._put(message, name)
            self._anonymous.extend(anonymous)
            self._changed(Action.LOADED)

    def names(self) -> tuple[str, ...]:
        """Returns the stored names in alphabetical order."""
        with self._lock:
            return tuple(sorted(self._named))

    def anonymous_count(self) -> int:
        """Returns how many anonymous messages wait to be read."""
        with self._lock:
            return len(self._anonymous)
