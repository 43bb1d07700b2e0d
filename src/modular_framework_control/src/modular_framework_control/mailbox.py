# SPDX-License-Identifier: BSD-3-Clause
"""Orders for the control loop from threads that it must not wait for.

Any thread may put an order in, the loop empties the mailbox once a cycle, and whoever stops a controller empties it
too. There is no lock, because a thread that holds one may be put aside while the loop waits for it; appending to a
deque and taking from it are each one indivisible step.
"""
from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

OrderT = TypeVar("OrderT")


class Mailbox(Generic[OrderT]):
    """Orders in the sequence in which they were put in; each is taken once, whoever takes it."""

    def __init__(self) -> None:
        self._orders: deque[OrderT] = deque()

    def put(self, order: OrderT) -> None:
        """Leave an order; returns at once."""
        self._orders.append(order)

    def taken(self) -> Iterator[OrderT]:
        """Take one order after the other until none is left, those put in meanwhile included."""
        while True:
            try:
                order = self._orders.popleft()
            except IndexError:  # asking first would not do: two threads may empty it
                return
            yield order

    def work_off(self, handle: Callable[[OrderT], None]) -> None:
        """Give one order after the other to `handle`; one on which it raises stays in, as the first, for who ends it.

        Raises:
            Exception: what `handle` raised.
        """
        for order in self.taken():
            try:
                handle(order)
            except Exception:
                self._orders.appendleft(order)
                raise
