# SPDX-License-Identifier: BSD-3-Clause
"""Keeps messages of one kind so that components which never meet can hand them to each other.

A message stored with a name stays until it is overwritten or removed. A message stored without a name joins a queue:
the oldest is handed out first and leaves the queue for good.
"""
from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

MessageT = TypeVar("MessageT")


class MessageNotFoundError(LookupError):
    """No message answers the request; the text says what was asked for and what there is.

    Args:
        kind: Noun of the stored messages, for example ``joint state``.
        name: Name that was asked for; empty for the anonymous queue.
        known_names: Names the store does hold.
    """

    def __init__(self, kind: str, name: str, known_names: tuple[str, ...]) -> None:
        self.kind, self.name, self.known_names = kind, name, known_names
        allowed = ", ".join(known_names) if known_names else "none"
        if name:
            text = f"No {kind} named '{name}' is stored. Stored names: {allowed}. Add it first or correct the name."
        else:
            text = (f"No anonymous {kind} is waiting to be read: none was added, or all were handed out already. "
                    f"Stored names: {allowed}. Add one, or ask by name.")
        super().__init__(text)


class MessageStore(Generic[MessageT]):
    """Thread-safe store of the messages of one kind.

    Args:
        kind: Noun used in error texts, for example ``grasp``.
        on_named: Called with (message, name) before a named message is stored; may complete the message in place.
    """

    def __init__(self, kind: str, on_named: Callable[[MessageT, str], None] | None = None) -> None:
        self.kind = kind
        self._on_named = on_named
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
                return False
            if self._on_named is not None:
                self._on_named(message, name)
            replaced = name in self._named
            self._named[name] = message
            return replaced

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
                return self._anonymous.popleft()
            raise MessageNotFoundError(self.kind, name, tuple(sorted(self._named)))

    def names(self) -> tuple[str, ...]:
        """Returns the stored names in alphabetical order."""
        with self._lock:
            return tuple(sorted(self._named))

    def anonymous_count(self) -> int:
        """Returns how many anonymous messages wait to be read."""
        with self._lock:
            return len(self._anonymous)
