# SPDX-License-Identifier: BSD-3-Clause
"""A state that sends a goal to any action server."""

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
from modular_framework_states.message_filling import FillingError, difference, fill_message, with_userdata
from modular_framework_states.responses import (
    KeptFields,
    MessageFields,
    OutcomeValues,
    Response,
    ResponseRules,
    end_by_response,
)

RESULT_KEY = "result"


class CallAction(FrameworkState):
    """Sends a goal and waits for its end; positive if the goal succeeded with the expected result.

    The string ``userdata.<key>`` in a goal or expectation is replaced by the userdata at that input key, and
    ``userdata.<key>.<field>`` by a field of it.

    Args:
        action_name: Name of the action; its type is determined when the action is available.
        goal: Field to value, nested like the goal; other fields keep their default.
        expect: Field to expected value of the result, nested like the result.
        outcome_field: Field of the result that selects the outcome: true for the first outcome, false for the last, an
            integer for an index, a string for a name. The field also selects the outcome of an
            aborted goal, which is never the first.
        outcome_values: Outcome to the value, or list of values, of that field; any other value is a failure.
        keep: Userdata key to the result field stored there; the keys must be output keys.
        timeout: Maximum wait for the end of the goal [s], after which the goal is cancelled.
        server_timeout: Maximum wait for the action server [s].
        **keys: Outcomes and userdata keys of any state; the output key ``result`` receives the result.
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
        self._rules = ResponseRules.of(self, outcome_field, outcome_values, keep)

    def execute(self, userdata: Any) -> str:
        """Sends the goal and waits for its end."""
        name = rospy.resolve_name(self._name)
        try:
            action_type = self._type_of(name)
            goal = fill_message(type(action_type().action_goal.goal), self._goal, userdata)
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
        result, stated_reason = client.get_result(), client.get_goal_status_text() or "no reason given"
        label = f"action '{name}' ended as {GoalStatus.to_string(status)}: {stated_reason}"
        aborted = status == GoalStatus.ABORTED and self._rules.outcome_field
        if result is None or (status != GoalStatus.SUCCEEDED and not aborted):
            return self.fail(label)
        if RESULT_KEY in self.get_registered_output_keys():
            userdata[RESULT_KEY] = result
        wrong = difference(result, expected)
        if wrong:
            return self.fail(f"action '{name}' ended as {GoalStatus.to_string(status)}, but {wrong}")
        response = Response(message=result, what=label, reason=stated_reason, aborted=bool(aborted))
        return end_by_response(self, self._rules, response, userdata)

    def _type_of(self, name: str) -> Any:
        found_types: list[str] = []

        def is_type_known() -> bool:
            kind, _, _ = rostopic.get_topic_type(f"{name}/goal")
            found_types[:] = [kind] if kind else []
            return bool(kind)

        if (
            not wait_until(lambda: is_type_known() or self.preempt_requested(), self._server_timeout_s, 0.1)
            or not found_types
        ):
            raise CallError(f"nobody offers it within {self._server_timeout_s:.1f} s; start its node")
        action_type = roslib.message.get_message_class(found_types[0].removesuffix("Goal"))
        if action_type is None:
            raise CallError(f"its type {found_types[0].removesuffix('Goal')} is not built in this workspace")
        return action_type
