# SPDX-License-Identifier: BSD-3-Clause
"""The goals an action server works on, of which a new one cancels those before it."""

from __future__ import annotations

import threading
from typing import Any


class RunningGoals:
    """Goals by their handle, each with an event that is set when it is cancelled."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._cancelled: dict[str, threading.Event] = {}

    def add(self, handle: Any) -> threading.Event:
        """Cancels all goals there are, adds a new one and returns its event."""
        cancelled = threading.Event()
        with self._lock:
            for event in self._cancelled.values():
                event.set()
            self._cancelled[handle.get_goal_id().id] = cancelled
        return cancelled

    def cancel(self, handle: Any) -> None:
        """Cancels a goal; one that has ended is left alone."""
        name = handle.get_goal_id().id
        with self._lock:
            cancelled = self._cancelled.get(name)
        if cancelled is not None:
            cancelled.set()

    def remove(self, handle: Any) -> None:
        """Forgets a goal that has ended."""
        name = handle.get_goal_id().id  # takes the server's lock, which is held where add() and cancel() are called
        with self._lock:
            self._cancelled.pop(name, None)
