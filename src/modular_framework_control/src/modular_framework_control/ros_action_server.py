# SPDX-License-Identifier: BSD-3-Clause
"""The action server of a controller: goals become tickets, and what becomes of a ticket is told to the client."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from actionlib.server_goal_handle import ServerGoalHandle

from modular_framework_control.goal_ticket import GoalStatus, GoalTicket
from modular_framework_control.ros_outbox import Outbox
from modular_framework_ros.action_server import SteadyActionServer

Submit = Callable[[Any, GoalTicket[Any]], None]
MakeResult = Callable[[GoalTicket[Any]], Any]


class GoalRefusedError(Exception):
    """A goal is refused at once; carries the result to send."""

    def __init__(self, result: Any, text: str) -> None:
        super().__init__(text)
        self.result = result


class ControllerActionServer:
    """Serves one action of a controller with any number of goals, of which the newest is followed.

    Args:
        name: absolute action name.
        action: the action's message class.
        submit: hands a goal message and its ticket to the controller, or raises GoalRefusedError.
        cancel: asks the controller to end a ticket.
        make_result: result message of a finished ticket.
        outbox: thread that talks to ROS for the control loop.
    """

    def __init__(self, name: str, action: type[Any], submit: Submit, cancel: Callable[[Any], None],
                 make_result: MakeResult, outbox: Outbox) -> None:
        self._submit = submit
        self._cancel = cancel
        self._make_result = make_result
        self._outbox = outbox
        self._goals: dict[GoalTicket[Any], ServerGoalHandle] = {}
        self._server = SteadyActionServer(name, action, self._on_goal, self._on_cancel, auto_start=False)
        self._server.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def publish_feedback(self, ticket: GoalTicket[Any], feedback: Any) -> None:
        """Send feedback to the client of `ticket`; nothing happens when the goal has ended meanwhile."""
        goal = self._goals.get(ticket)
        if goal is not None:
            goal.publish_feedback(feedback)

    def _on_goal(self, goal: ServerGoalHandle) -> None:
        ticket: GoalTicket[Any] = GoalTicket(lambda changed: self._outbox.put(self._tell, changed, changed.status))
        self._goals[ticket] = goal
        try:
            self._submit(goal.get_goal(), ticket)
        except GoalRefusedError as error:
            del self._goals[ticket]
            rospy.logwarn("%s: goal rejected: %s", self._server.ns, error)
            goal.set_rejected(error.result, str(error))
        except Exception as error:  # whatever is in the message, its sender gets an answer
            del self._goals[ticket]
            rospy.logerr("%s: goal rejected: %s: %s", self._server.ns, type(error).__name__, error)
            goal.set_rejected(None, f"{type(error).__name__}: {error}")

    def _on_cancel(self, goal: ServerGoalHandle) -> None:
        for ticket, known in list(self._goals.items()):
            if known == goal:
                self._cancel(ticket)

    def _tell(self, ticket: GoalTicket[Any], status: GoalStatus) -> None:
        goal = self._goals[ticket]
        if status is GoalStatus.ACTIVE:
            goal.set_accepted()
            return
        del self._goals[ticket]
        finish = {GoalStatus.SUCCEEDED: goal.set_succeeded, GoalStatus.ABORTED: goal.set_aborted,
                  GoalStatus.CANCELED: goal.set_canceled, GoalStatus.REJECTED: goal.set_rejected}[status]
        if status in (GoalStatus.ABORTED, GoalStatus.REJECTED):
            rospy.logwarn("%s: goal %s: %s", self._server.ns, status.value, ticket.text)
        finish(self._make_result(ticket), ticket.text)
