# SPDX-License-Identifier: BSD-3-Clause
"""The state of one goal inside a controller, shared with the action server that received it.

The control loop changes a goal handle and calls its listener, which must not block: the ROS interface of a controller
only puts the new status into a queue that another thread processes.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Generic, TypeVar

ResultT = TypeVar("ResultT")


class GoalStatus(Enum):
    """Status of a goal; the last four are final."""

    PENDING = "pending"
    ACTIVE = "active"
    REJECTED = "rejected"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


class RealtimeGoalHandle(Generic[ResultT]):
    """State and result of one goal.

    Args:
        listener: called in the control loop with this goal handle.

    Attributes:
        status: of the goal.
        result: set together with a final status.
        text: why the goal ended, for people.
    """

    __slots__ = ("status", "result", "text", "_listener")

    def __init__(self, listener: Callable[[RealtimeGoalHandle[ResultT]], None] | None = None) -> None:
        self.status = GoalStatus.PENDING
        self.result: ResultT | None = None
        self.text = ""
        self._listener = listener

    @property
    def open(self) -> bool:
        """Whether the goal is pending or active."""
        return self.status in (GoalStatus.PENDING, GoalStatus.ACTIVE)

    def activate(self) -> None:
        """Marks the goal as active."""
        self.status = GoalStatus.ACTIVE
        self._notify()

    def finish(self, status: GoalStatus, result: ResultT, text: str = "") -> None:
        """Ends the goal; a second call has no effect."""
        if not self.open:
            return
        self.status, self.result, self.text = status, result, text
        self._notify()

    def _notify(self) -> None:
        if self._listener is not None:
            self._listener(self)
