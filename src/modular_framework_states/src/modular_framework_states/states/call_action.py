# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task send a goal to any action server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import roslib.message
import rospy
import rostopic
from actionlib_msgs.msg import GoalStatus

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import CallError, wait_for_action, wait_for_result, wait_until
from modular_framework_states.answers import AnswerRules, KeptFields, MessageFields, OutcomeValues, end_with
from modular_framework_states.message_filling import FillingError, difference, filled, with_userdata

RESULT = "result"


class CallAction(FrameworkState):
    """Sends a goal and waits for its end; positive when the goal succeeded and the result is as expected.

    A text ``userdata.<key>`` in a goal or expectation stands for what userdata has there, and
    ``userdata.<key>.<field>`` for a field of it; the key must be an input key.

    Args:
        action_name: Action; its type is found out when it is there.
        goal: Field to value, nested as the goal is; fields left out keep their default.
        expect: Field to value of the result, nested as it is.
        outcome_field: Field of the result that decides about the outcome: true is the first outcome, false the last, a
            whole number the outcome with that number, from 0, a text the one it names. It decides for an aborted goal
            too, for which the first outcome is never given.
        outcome_values: Outcome to the value of that field, or a list of values, that stands for it; any other value
            is a failure.
        keep: Userdata key to the field of the result that it receives; the keys must be output keys.
        timeout: Longest wait for the end of the goal [s]; a goal that takes longer is cancelled.
        server_timeout: Longest wait for the action server [s].
        **keys: Outcomes and userdata keys of any state; ``result`` receives the result if it is an output key.
    """

    def __init__(
        self,
        action_name: str,
        goal: MessageFields | None = None,
        expect: MessageFields | None = None,
        timeout: NotNegative = 60.0,
        server_timeout: NotNegative = 10.0,
        outcome_field: str = "",
        outcome_values: OutcomeValues | None = None,
        keep: KeptFields | None = None,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._name, self._goal, self._expected = str(action_name), dict(goal or {}), dict(expect or {})
        self._timeout_s, self._server_timeout_s = float(timeout), float(server_timeout)
        self._rules = AnswerRules.of(self, outcome_field, outcome_values, keep)

    def execute(self, userdata: Any) -> str:
        """Sends the goal and waits."""
        name = rospy.resolve_name(self._name)
        try:
            action_type = self._type_of(name)
            goal = filled(type(action_type().action_goal.goal), self._goal, userdata)
            expected = with_userdata(self._expected, userdata)
            client = SteadyActionClient(name, action_type)
            wait_for_action(client, name, self._server_timeout_s)
        except (CallError, FillingError) as error:
            return self.fail(f"action '{name}': {error}")
        if self.preempt_requested():
            return self.stopped()
        client.send_goal(goal)
        status = wait_for_result(client, self._timeout_s, self.preempt_requested)
        if self.preempt_requested():
            return self.stopped()
        if status == GoalStatus.LOST:
            return self.fail(f"action '{name}' did not end within {self._timeout_s} s; the goal was cancelled")
        return self._end(name, client, status, expected, userdata)

    def _end(self, name: str, client: Any, status: int, expected: Mapping[str, Any], userdata: Any) -> str:
        """Returns the outcome of a goal that has ended."""
        result, reason_given = client.get_result(), client.get_goal_status_text() or "it gave no reason"
        what = f"action '{name}' ended as {GoalStatus.to_string(status)}: {reason_given}"
        aborted = status == GoalStatus.ABORTED and self._rules.outcome_field
        if result is None or (status != GoalStatus.SUCCEEDED and not aborted):
            return self.fail(what)
        if RESULT in self.get_registered_output_keys():
            userdata[RESULT] = result
        wrong = difference(result, expected)
        if wrong:
            return self.fail(f"action '{name}' ended as {GoalStatus.to_string(status)}, but {wrong}")
        return end_with(self, self._rules, result, userdata, what, reason_given, aborted=bool(aborted))

    def _type_of(self, name: str) -> Any:
        found: list[str] = []

        def known() -> bool:
            kind, _, _ = rostopic.get_topic_type(f"{name}/goal")
            found[:] = [kind] if kind else []
            return bool(kind)

        if not wait_until(lambda: known() or self.preempt_requested(), self._server_timeout_s, 0.1) or not found:
            raise CallError(f"nobody offers it within {self._server_timeout_s:.1f} s; start the node that does")
        action_type = roslib.message.get_message_class(found[0].removesuffix("Goal"))
        if action_type is None:
            raise CallError(f"its type {found[0].removesuffix('Goal')} is not built in this workspace")
        return action_type
