# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task call any service."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rospy
import rosservice

from modular_framework_core.framework_state import FrameworkState
from modular_framework_core.option_limits import NotNegative
from modular_framework_core.ros_calls import CallError, call_service, wait_until
from modular_framework_states.message_filling import FillingError, difference, filled

ANSWER = "response"


class CallService(FrameworkState):
    """Calls a service; positive when the answer's field ``success`` (or ``ok``), if it has one, is true and all is as
    expected.

    Args:
        service_name: Service; its type is found out when it is there.
        request: Field to value, nested as the request is; fields left out keep their default.
        expect: Field to value of the answer, nested as it is.
        timeout: Longest wait for the service, and again for its answer [s].
        outcomes: First positive, last negative.
        input_keys: Userdata that is read.
        output_keys: Userdata that is written.
        io_keys: Userdata that is read and written.
            ``response`` receives the answer when it is listed.
    """

    def __init__(self, service_name: str, request: Mapping[str, Any] | None = None,
                 expect: Mapping[str, Any] | None = None, timeout: NotNegative = 10.0,
                 outcomes: Sequence[str] = ("success", "fail"),
                 input_keys: Sequence[str] = (), output_keys: Sequence[str] = (), io_keys: Sequence[str] = ()) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self._name, self._request, self._expected = str(service_name), dict(request or {}), dict(expect or {})
        self._timeout_s = float(timeout)

    def execute(self, userdata: Any) -> str:
        """Calls the service and looks at the answer."""
        name = rospy.resolve_name(self._name)
        try:
            if not wait_until(lambda: rosservice.get_service_type(name) is not None or self.preempt_requested(),
                              self._timeout_s, 0.1):
                return self.fail(f"service '{name}' was not advertised within {self._timeout_s} s; start the node that "
                                 "offers it")
            if self.preempt_requested():
                return self.stopped()
            service_type = rosservice.get_service_class_by_name(name)
            request = filled(service_type._request_class, self._request)
            answer = call_service(rospy.ServiceProxy(name, service_type), request, self._timeout_s)
        except (CallError, FillingError, rosservice.ROSServiceException) as error:
            return self.fail(f"service '{name}': {error}")
        for field in ("success", "ok"):
            if getattr(answer, field, True) is False:
                said = next((str(getattr(answer, text)) for text in ("message", "status_message")
                             if getattr(answer, text, "")), "it gave no reason")
                return self.fail(f"service '{name}' answered {field}: false: {said}")
        wrong = difference(answer, self._expected)
        if wrong:
            return self.fail(f"service '{name}' answered, but {wrong}")
        if ANSWER in self.get_registered_output_keys():
            userdata[ANSWER] = answer
        return self.succeed()
