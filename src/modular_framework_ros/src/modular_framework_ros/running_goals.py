# SPDX-License-Identifier: BSD-3-Clause
"""Tracks the running goals of an action server; a new goal cancels the goals that use the same resources."""

from __future__ import annotations

import threading
from typing import Any


def overlap(first: frozenset[str] | None, second: frozenset[str] | None) -> bool:
    """Returns whether two sets of resources intersect; None stands for all resources."""
    return first is None or second is None or not first.isdisjoint(second)


class RunningGoals:
    """The running goals by their handle, each with an event that is set when the goal is cancelled."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._goals: dict[str, tuple[threading.Event, frozenset[str] | None]] = {}

    def add(self, handle: Any, uses: frozenset[str] | None = None) -> threading.Event:
        """Cancels the goals that share resources with a new goal, adds the new goal and returns its event.

        Args:
            handle: Handle of the new goal.
            uses: Names of the used resources, such as joints; None for all resources.
        """
        cancelled = threading.Event()
        with self._lock:
            for event, used in self._goals.values():
                if overlap(used, uses):
                    event.set()
            self._goals[handle.get_goal_id().id] = (cancelled, uses)
        return cancelled

    def cancel(self, handle: Any) -> None:
        """Cancels a goal; a goal that has ended is ignored."""
        name = handle.get_goal_id().id
        with self._lock:
            goal = self._goals.get(name)
        if goal is not None:
            goal[0].set()

    def remove(self, handle: Any) -> None:
        """Removes a goal that has ended."""
        name = handle.get_goal_id().id  # takes the lock that the callers of add() and cancel() hold
        with self._lock:
            self._goals.pop(name, None)
