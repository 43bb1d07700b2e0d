# SPDX-License-Identifier: BSD-3-Clause
"""The action server of a controller: goals become tickets, and what becomes of a ticket is told to the client."""
from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from actionlib import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle

from modular_framework_control.goal_ticket import GoalStatus, GoalTicket
from modular_framework_control.ros_outbox import Outbox
from modular_framework_control.ros_telling import going_down

Submit = Callable[[Any, GoalTicket[Any]], None]
MakeResult = Callable[[GoalTicket[Any]], Any]

# actionlib's simple client never learns of an end that reaches it before its send_goal() has returned
EARLIEST_END_S = 0.05
LAST_WORD_S = 0.15
"""For a result to get out: to close a topic drops what rospy's threads have still to write [s]."""


class SteadyActionServer(ActionServer):
    """An action server whose status topic survives a reset of the simulated clock, and whose clients hear of every end.

    A goal that ends at once is told so EARLIEST_END_S after it came.
    """

    def initialize(self) -> None:
        self._came_s: dict[str, float] = {}
        self._told_s = -LAST_WORD_S
        self._ends_to_tell: set[threading.Timer] = set()
        super().initialize()
        timer: rospy.Timer | None = getattr(self, "status_timer", None)
        if timer is not None:
            timer.shutdown()
            period = rospy.Duration(1.0 / self.status_frequency)
            self.status_timer = rospy.Timer(period, self.publish_status_async, reset=True)

    def internal_goal_callback(self, goal: Any) -> None:
        self._came_s[goal.goal_id.id] = time.monotonic()
        super().internal_goal_callback(goal)

    def publish_result(self, status: Any, result: Any) -> None:
        early_s = self._came_s.pop(status.goal_id.id, 0.0) + EARLIEST_END_S - time.monotonic()
        if early_s <= 0.0:
            self._tell_end(status, result)
            return
        later = threading.Timer(early_s, self._tell_end, (status, result))  # whoever calls has other work to do
        later.daemon = True
        self._ends_to_tell.add(later)
        later.start()

    def _tell_end(self, status: Any, result: Any) -> None:
        try:
            super().publish_result(status, result)
        except rospy.ROSException:
            if not going_down():
                raise
        self._told_s = time.monotonic()
        self._ends_to_tell.discard(threading.current_thread())  # type: ignore[arg-type]

    def stop(self) -> None:
        """Stop serving, once every end has been told."""
        for later in list(self._ends_to_tell):
            later.join()
        time.sleep(max(0.0, self._told_s + LAST_WORD_S - time.monotonic()))
        super().stop()

    def publish_status(self) -> None:
        try:
            super().publish_status()
        except rospy.ROSException:
            if not going_down():
                raise


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
