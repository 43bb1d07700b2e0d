# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task call any service."""

from __future__ import annotations

from typing import Any, Unpack

import rospy
import rosservice

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative
from modular_framework_ros.calls import CallError, call_service, wait_until
from modular_framework_states.answers import AnswerRules, KeptFields, MessageFields, OutcomeValues, end_with
from modular_framework_states.message_filling import FillingError, difference, filled, with_userdata

ANSWER = "response"


class CallService(FrameworkState):
    """Calls a service; positive when its answer is as expected.

    The answer's field ``success`` (or ``ok``), if it has one, must be true, too.

    A text ``userdata.<key>`` in a request or expectation stands for what userdata has there, and
    ``userdata.<key>.<field>`` for a field of it; the key must be an input key.

    Args:
        service_name: Service; its type is found out when it is there.
        request: Field to value, nested as the request is; fields left out keep their default.
        expect: Field to value of the answer, nested as it is.
        outcome_field: Field of the answer that decides about the outcome, instead of ``success`` or ``ok``: true is the
            first outcome, false the last, a whole number the outcome with that number, from 0, a text the one it names.
        outcome_values: Outcome to the value of that field, or a list of values, that stands for it; any other value
            is a failure.
        keep: Userdata key to the field of the answer that it receives; the keys must be output keys.
        timeout: Longest wait for the service, and again for its answer [s].
        **keys: Outcomes and userdata keys of any state; ``response`` receives the answer if it is an output key.
    """

    def __init__(
        self,
        service_name: str,
        request: MessageFields | None = None,
        expect: MessageFields | None = None,
        timeout: NotNegative = 10.0,
        outcome_field: str = "",
        outcome_values: OutcomeValues | None = None,
        keep: KeptFields | None = None,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._name, self._request, self._expected = str(service_name), dict(request or {}), dict(expect or {})
        self._timeout_s = float(timeout)
        self._rules = AnswerRules.of(self, outcome_field, outcome_values, keep)

    def execute(self, userdata: Any) -> str:
        """Calls the service and checks the answer."""
        name = rospy.resolve_name(self._name)
        try:
            if not wait_until(
                lambda: rosservice.get_service_type(name) is not None or self.preempt_requested(), self._timeout_s, 0.1
            ):
                return self.fail(
                    f"service '{name}' was not advertised within {self._timeout_s} s; start the node that offers it"
                )
            if self.preempt_requested():
                return self.stopped()
            service_type = rosservice.get_service_class_by_name(name)
            request = filled(service_type._request_class, self._request, userdata)
            expected = with_userdata(self._expected, userdata)
            answer = call_service(rospy.ServiceProxy(name, service_type), request, self._timeout_s)
        except (CallError, FillingError, rosservice.ROSServiceException) as error:
            return self.fail(f"service '{name}': {error}")
        if ANSWER in self.get_registered_output_keys():
            userdata[ANSWER] = answer
        for field in () if self._rules.outcome_field else ("success", "ok"):
            if getattr(answer, field, True) is False:
                return self.fail(f"service '{name}' answered {field}: false: {_reason_in(answer)}")
        wrong = difference(answer, expected)
        if wrong:
            return self.fail(f"service '{name}' answered, but {wrong}")
        return end_with(self, self._rules, answer, userdata, f"service '{name}'", _reason_in(answer))


def _reason_in(answer: Any) -> str:
    """Returns the reason an answer gives in its fields."""
    return next(
        (str(getattr(answer, text)) for text in ("message", "status_message") if getattr(answer, text, "")),
        "it gave no reason",
    )
