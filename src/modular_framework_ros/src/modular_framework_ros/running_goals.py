# SPDX-License-Identifier: BSD-3-Clause
"""The goals an action server works on, of which a new one cancels those before it that use the same."""

from __future__ import annotations

import threading
from typing import Any


def overlap(one: frozenset[str] | None, other: frozenset[str] | None) -> bool:
    """Returns whether two goals use something in common; None is everything."""
    return one is None or other is None or not one.isdisjoint(other)


class RunningGoals:
    """Goals by their handle, each with an event that is set when it is cancelled."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._goals: dict[str, tuple[threading.Event, frozenset[str] | None]] = {}

    def add(self, handle: Any, uses: frozenset[str] | None = None) -> threading.Event:
        """Cancels the goals that use something a new one uses, adds that and returns its event.

        Args:
            handle: The new goal.
            uses: Names of what it uses, such as joints; None: everything.
        """
        cancelled = threading.Event()
        with self._lock:
            for event, used in self._goals.values():
                if overlap(used, uses):
                    event.set()
            self._goals[handle.get_goal_id().id] = (cancelled, uses)
        return cancelled

    def cancel(self, handle: Any) -> None:
        """Cancels a goal; one that has ended is left alone."""
        name = handle.get_goal_id().id
        with self._lock:
            goal = self._goals.get(name)
        if goal is not None:
            goal[0].set()

    def remove(self, handle: Any) -> None:
        """Forgets a goal that has ended."""
        name = handle.get_goal_id().id  # takes the server's lock, which is held where add() and cancel() are called
        with self._lock:
            self._goals.pop(name, None)
