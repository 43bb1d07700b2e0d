# SPDX-License-Identifier: BSD-3-Clause
"""Base classes of the node's endpoints (capabilities)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from threading import Event
from typing import Any

import rospy

from modular_framework_planning.errors import ErrorCode
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalEnd, GoalRunner, error_code_of

PublishState = Callable[[str], None]


class MoveGroupCapability(ABC):
    """An endpoint of the node.

    Args:
        context: Shared parts of the node.
    """

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    @abstractmethod
    def connect(self) -> None:
        """Advertises the endpoint."""


class ServiceCapability(MoveGroupCapability):
    """Offers the service `name` of type `kind`."""

    name: str
    kind: Any

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(self.name, self.kind, self._serve)

    @abstractmethod
    def _serve(self, request: Any) -> Any:
        """Returns the response."""


class ActionCapability(MoveGroupCapability):
    """Offers the action `name` of type `kind`; a goal succeeds if its result has the code SUCCESS."""

    name: str
    kind: Any

    def connect(self) -> None:
        """Starts the action server."""
        self._runner = GoalRunner(self.name, self.kind, self._execute, self._resources)
        self._runner.connect()

    def _execute(self, goal: Any, cancelled: Event, feedback: Callable[[Any], None]) -> GoalEnd:
        feedback_type = type(self.kind().action_feedback.feedback)
        result, text = self._perform(goal, cancelled, lambda state: feedback(feedback_type(state)))
        return GoalEnd(result, error_code_of(result).val == ErrorCode.SUCCESS, text)

    def _resources(self, goal: Any) -> frozenset[str] | None:
        """Returns the joints that a goal moves; None for all joints, so that every new goal cancels this goal."""
        return None

    @abstractmethod
    def _perform(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[Any, str]:
        """Executes a goal and returns the result and a text for the client.

        Args:
            goal: Goal message.
            cancelled: Event that is set when the client cancels the goal.
            publish_state: Function that publishes the state of the goal as feedback.
        """
