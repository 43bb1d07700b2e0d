# SPDX-License-Identifier: BSD-3-Clause
"""A state that calls any service."""

from __future__ import annotations

from typing import Any, Unpack

import rospy
import rosservice

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative
from modular_framework_ros.calls import CallError, call_service, wait_until
from modular_framework_states.message_filling import FillingError, difference, fill_message, with_userdata
from modular_framework_states.responses import (
    KeptFields,
    MessageFields,
    OutcomeValues,
    Response,
    ResponseRules,
    end_by_response,
)

RESPONSE_KEY = "response"


class CallService(FrameworkState):
    """Calls a service; positive if the response has the expected values.

    A field ``success`` or ``ok`` of the response must also be true.

    The string ``userdata.<key>`` in a request or expectation is replaced by the userdata at that input key, and
    ``userdata.<key>.<field>`` by a field of it.

    Args:
        service_name: Name of the service; its type is determined when the service is available.
        request: Field to value, nested like the request; other fields keep their default.
        expect: Field to expected value of the response, nested like the response.
        outcome_field: Field of the response that selects the outcome instead of ``success`` or ``ok``: true for the
            first outcome, false for the last, an integer for an index, a string for a name.
        outcome_values: Outcome to the value, or list of values, of that field; any other value is a failure.
        keep: Userdata key to the response field stored there; the keys must be output keys.
        timeout: Maximum wait for the service, and then for its response [s].
        **keys: Outcomes and userdata keys of any state; the output key ``response`` receives the response.
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
        self._rules = ResponseRules.of(self, outcome_field, outcome_values, keep)

    def execute(self, userdata: Any) -> str:
        """Calls the service and checks the response."""
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
            request = fill_message(service_type._request_class, self._request, userdata)
            expected = with_userdata(self._expected, userdata)
            response = call_service(rospy.ServiceProxy(name, service_type), request, self._timeout_s)
        except (CallError, FillingError, rosservice.ROSServiceException) as error:
            return self.fail(f"service '{name}': {error}")
        if RESPONSE_KEY in self.get_registered_output_keys():
            userdata[RESPONSE_KEY] = response
        for field in () if self._rules.outcome_field else ("success", "ok"):
            if getattr(response, field, True) is False:
                return self.fail(f"service '{name}' answered {field}: false: {_reason_in(response)}")
        wrong = difference(response, expected)
        if wrong:
            return self.fail(f"service '{name}' answered, but {wrong}")
        answer = Response(message=response, what=f"service '{name}'", reason=_reason_in(response))
        return end_by_response(self, self._rules, answer, userdata)


def _reason_in(response: Any) -> str:
    """Returns the reason in the fields of a response."""
    return next(
        (str(getattr(response, text)) for text in ("message", "status_message") if getattr(response, text, "")),
        "no reason given",
    )
