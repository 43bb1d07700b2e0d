# SPDX-License-Identifier: BSD-3-Clause
"""The state of one goal inside a controller, shared with the action server that received the goal.

The control loop changes a goal handle and calls its listener, which must not block. A controller's ROS interface only
queues the new status for another thread.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Generic, TypeVar

ResultT = TypeVar("ResultT")


class GoalStatus(Enum):
    """Status of a goal; the last four values are final."""

    PENDING = "pending"
    ACTIVE = "active"
    REJECTED = "rejected"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


class RealtimeGoalHandle(Generic[ResultT]):
    """State and result of one goal.

    Args:
        listener: Function called in the control loop with this goal handle after each change.

    Attributes:
        status: Status of the goal.
        result: Result of the goal; None before a final status.
        text: Reason for the end of the goal, for users.
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
        """Ends the goal; later calls have no effect.

        Args:
            status: Final status.
            result: Result of the goal.
            text: Reason, for users.
        """
        if not self.open:
            return
        self.status, self.result, self.text = status, result, text
        self._notify()

    def _notify(self) -> None:
        if self._listener is not None:
            self._listener(self)
