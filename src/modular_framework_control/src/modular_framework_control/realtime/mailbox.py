# SPDX-License-Identifier: BSD-3-Clause
"""Goals and cancellations for the control loop, from threads that it must not wait for.

Any thread may put an item in; the loop drains the mailbox once per cycle, and so does whoever stops a controller. There
is no lock, because the loop would have to wait while the thread that holds it is not running. Appending to a deque and
taking from it are atomic.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")


class Mailbox(Generic[ItemT]):
    """Items in the sequence in which they were put in; each is taken out once, by whichever thread drains first."""

    def __init__(self) -> None:
        self._items: deque[ItemT] = deque()

    def put(self, item: ItemT) -> None:
        """Appends an item; returns at once."""
        self._items.append(item)

    def drain(self) -> Iterator[ItemT]:
        """Takes items out until none is left, including those put in meanwhile."""
        while True:
            try:
                item = self._items.popleft()
            except IndexError:  # to check first is not enough: two threads may drain it
                return
            yield item

    def process(self, handle: Callable[[ItemT], None]) -> None:
        """Takes items out and calls `handle` with each; one on which it raises is put back as the first.

        Raises:
            Exception: what `handle` raised.
        """
        for item in self.drain():
            try:
                handle(item)
            except Exception:
                self._items.appendleft(item)
                raise
