# SPDX-License-Identifier: BSD-3-Clause
"""Stores messages of one kind, which decouples the nodes that exchange them.

A named message stays until it is overwritten or removed. Anonymous messages form a queue: reading removes the oldest
message.
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
MAX_LISTED_NAMES = 10
"""Maximum number of names in an error message, because every log subscriber receives the message."""


class Action(Enum):
    """Kind of a change of a store."""

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
        action: Kind of the change.
        name: Name of the message; "" for an anonymous message or several messages.
        named: Number of named messages after the change.
        anonymous: Number of anonymous messages after the change.
    """

    action: Action
    name: str
    named: int
    anonymous: int


class MessageNotFoundError(LookupError):
    """The store has no message for the request.

    Args:
        kind: Noun for the stored messages, for example ``joint state``.
        name: Requested name; "" for the anonymous queue.
        known_names: Stored names, sorted.
    """

    def __init__(self, kind: str, name: str, known_names: tuple[str, ...]) -> None:
        self.kind, self.name, self.known_names = kind, name, known_names
        start = max(0, bisect.bisect(known_names, name) - MAX_LISTED_NAMES // 2) if name else 0
        listed = [item if len(item) <= 80 else f"{item[:80]}..." for item in known_names[start:][:MAX_LISTED_NAMES]]
        allowed = ", ".join(listed) or "none"
        if len(listed) < len(known_names):
            allowed += f" (the nearest of {len(known_names)} in the alphabet)"
        if name:
            text = f"No {kind} named '{name}' is stored. Stored names: {allowed}. Add it first or correct the name."
        else:
            text = (
                f"No anonymous {kind} is stored: none was added, or all were read. "
                f"Stored names: {allowed}. Add one, or request a stored name."
            )
        super().__init__(text)


class MessageStore(Generic[MessageT]):
    """Thread-safe store of messages of one kind.

    Args:
        kind: Noun for error messages, for example ``grasp``.
        on_named: Function called with (message, name) before a named message is stored. It may change the message.
        on_change: Function called after each change, in the order of the changes. It must not call the store.
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
            message: Message to store.
            name: Name of the message; "" to append to the anonymous queue.

        Returns:
            Whether a message of this name was replaced.
        """
        with self._lock:
            if not name:
                self._anonymous.append(message)
                self._notify(Action.ADDED)
                return False
            replaced = name in self._named
            self._put(message, name)
            self._notify(Action.REPLACED if replaced else Action.ADDED, name)
            return replaced

    def _put(self, message: MessageT, name: str) -> None:
        if self._on_named is not None:
            self._on_named(message, name)
        self._named[name] = message

    def _notify(self, action: Action, name: str = "") -> None:
        if self._on_change is not None:
            self._on_change(Change(action, name, len(self._named), len(self._anonymous)))

    def get(self, name: str = "") -> MessageT:
        """Returns a named message, or removes and returns the oldest anonymous message.

        Args:
            name: Name of the message; "" for the anonymous queue.

        Raises:
            MessageNotFoundError: The name is unknown, or the queue is empty.
        """
        with self._lock:
            if name and name in self._named:
                return self._named[name]
            if not name and self._anonymous:
                message = self._anonymous.popleft()
                self._notify(Action.HANDED_OUT)
                return message
            raise MessageNotFoundError(self.kind, name, tuple(sorted(self._named)))

    def remove(self, name: str) -> None:
        """Removes a named message.

        Raises:
            MessageNotFoundError: The name is unknown.
        """
        with self._lock:
            if name not in self._named:
                raise MessageNotFoundError(self.kind, name, tuple(sorted(self._named)))
            del self._named[name]
            self._notify(Action.REMOVED, name)

    def clear(self, *, named: bool = True) -> None:
        """Removes all anonymous messages and, if ``named`` is True, all named messages."""
        with self._lock:
            if named:
                self._named.clear()
            self._anonymous.clear()
            self._notify(Action.CLEARED)

    def contents(self) -> tuple[dict[str, MessageT], list[MessageT]]:
        """Returns the named messages, and the anonymous messages, oldest first, without removing them."""
        with self._lock:
            return dict(self._named), list(self._anonymous)

    def load(self, named: Mapping[str, MessageT], anonymous: Iterable[MessageT] = (), *, clear: bool = False) -> None:
        """Stores several messages atomically.

        Args:
            named: Messages by name, which replace stored messages of the same names.
            anonymous: Messages to append to the queue, oldest first.
            clear: Whether to remove all stored messages first.
        """
        with self._lock:
            if clear:
                self._named.clear()
                self._anonymous.clear()
            for name, message in named.items():
                self._put(message, name)
            self._anonymous.extend(anonymous)
            self._notify(Action.LOADED)

    def names(self) -> tuple[str, ...]:
        """Returns the stored names in alphabetical order."""
        with self._lock:
            return tuple(sorted(self._named))

    def anonymous_count(self) -> int:
        """Returns the number of anonymous messages."""
        with self._lock:
            return len(self._anonymous)
