# SPDX-License-Identifier: BSD-3-Clause
"""Base classes of the node's endpoints: a capability offers a service, an action, or whatever its `connect` opens."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from threading import Event
from typing import Any

import rospy

from modular_framework_planning.errors import ErrorCode
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.goal_runner import GoalRunner, error_code_of

PublishState = Callable[[str], None]


class MoveGroupCapability(ABC):
    """An endpoint of the node.

    Args:
        context: parts of the node.
    """

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    @abstractmethod
    def connect(self) -> None:
        """Advertises what the capability offers."""


class ServiceCapability(MoveGroupCapability):
    """Offers one service, called `name`, of the type `kind`."""

    name: str
    kind: Any

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(self.name, self.kind, self._serve)

    @abstractmethod
    def _serve(self, request: Any) -> Any:
        """Returns the response."""


class ActionCapability(MoveGroupCapability):
    """Offers one action, called `name`, of the type `kind`; a goal has succeeded where its result's code says so."""

    name: str
    kind: Any

    def connect(self) -> None:
        """Starts the action server."""
        self._runner = GoalRunner(self.name, self.kind, self._work, self._uses)
        self._runner.connect()

    def _work(self, goal: Any, cancelled: Event, feedback: Callable[[Any], None]) -> tuple[Any, bool, str]:
        feedback_type = type(self.kind().action_feedback.feedback)
        result, text = self._perform(goal, cancelled, lambda state: feedback(feedback_type(state)))
        return result, error_code_of(result).val == ErrorCode.SUCCESS, text

    def _uses(self, goal: Any) -> frozenset[str] | None:
        """Returns the joints a goal moves; None: any, so that a new goal cancels it."""
        return None

    @abstractmethod
    def _perform(self, goal: Any, cancelled: Event, publish_state: PublishState) -> tuple[Any, str]:
        """Works on a goal and returns the result with a sentence about it.

        Args:
            goal: the message.
            cancelled: set when the client gives the goal up.
            publish_state: publishes the goal's feedback.
        """
