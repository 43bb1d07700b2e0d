# SPDX-License-Identifier: BSD-3-Clause
"""Lock-free mailbox for goals and cancellations from other threads to the control loop.

Any thread may put an item. The loop drains the mailbox once per cycle, and a thread that stops a controller drains it
too. A lock could make the loop wait for a suspended thread; appending to and popping from a deque are atomic.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")


class Mailbox(Generic[ItemT]):
    """A FIFO queue; each item is taken once, by the thread that drains first."""

    def __init__(self) -> None:
        self._items: deque[ItemT] = deque()

    def put(self, item: ItemT) -> None:
        """Appends an item without waiting."""
        self._items.append(item)

    def drain(self) -> Iterator[ItemT]:
        """Yields items until the mailbox is empty, including items put meanwhile."""
        while True:
            try:
                item = self._items.popleft()
            except IndexError:  # a check would not be enough, because two threads may drain the mailbox
                return
            yield item

    def process(self, handle: Callable[[ItemT], None]) -> None:
        """Calls `handle` with each item; an item for which `handle` raises is put back as the first item.

        Raises:
            Exception: Error of `handle`.
        """
        for item in self.drain():
            try:
                handle(item)
            except Exception:
                self._items.appendleft(item)
                raise
