# SPDX-License-Identifier: BSD-3-Clause
"""One goal on its way through a controller: who sent it learns here what becomes of it.

The control loop changes a ticket and tells its listener; the listener must not block (the ROS edge puts the news in a
queue that another thread works off).
"""
from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Generic, TypeVar

ResultT = TypeVar("ResultT")


class GoalStatus(Enum):
    """Where a goal stands; the last four are final."""

    PENDING = "pending"
    ACTIVE = "active"
    REJECTED = "rejected"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


class GoalTicket(Generic[ResultT]):
    """State and result of one goal.

    Args:
        listener: called in the control loop with this ticket, the new status and the text for a human.

    Attributes:
        status: where the goal stands.
        result: set together with a final status.
        text: why it ended as it did.
    """

    __slots__ = ("status", "result", "text", "_listener")

    def __init__(self, listener: Callable[[GoalTicket[ResultT]], None] | None = None) -> None:
        self.status = GoalStatus.PENDING
        self.result: ResultT | None = None
        self.text = ""
        self._listener = listener

    @property
    def open(self) -> bool:
        """Whether the goal still waits or runs."""
        return self.status in (GoalStatus.PENDING, GoalStatus.ACTIVE)

    def activate(self) -> None:
        """The control loop has taken the goal up."""
        self.status = GoalStatus.ACTIVE
        self._tell()

    def finish(self, status: GoalStatus, result: ResultT, text: str = "") -> None:
        """The goal has come to an end; a second end is ignored."""
        if not self.open:
            return
        self.status, self.result, self.text = status, result, text
        self._tell()

    def _tell(self) -> None:
        if self._listener is not None:
            self._listener(self)
