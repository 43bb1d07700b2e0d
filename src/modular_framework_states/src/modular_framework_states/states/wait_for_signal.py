# SPDX-License-Identifier: BSD-3-Clause
"""A state that waits for a signal of another component."""

from __future__ import annotations

import math
import threading
from typing import Any, Unpack

import rospy
import rosservice
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_ros.calls import CallError, call_service
from modular_framework_ros.start_up import WaitReport, start_timeout

REASON_WAIT_S = 0.5


class WaitForSignal(FrameworkState):
    """Waits for a Bool on a topic; True gives the positive outcome.

    The state subscribes at its construction and uses the latest unread signal, even if the signal came before the
    execution. A component may give the reason of a False on ``<topic_name>/reason`` (std_msgs/String).

    A latched signal may come from an earlier task. A component that offers the service ``<topic_name>/renew``
    (std_srvs/Trigger) is called to renew the signal; its response replaces the signal.

    A component that has not yet published the topic has the time of the parameter ``/start_timeout`` to start;
    `timeout` begins when the component has started.

    Args:
        topic_name: Topic of the signal (std_msgs/Bool).
        timeout: Maximum wait [s]; None for no limit.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, topic_name: str, timeout: Positive | None = None, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._topic = str(topic_name)
        self._timeout_s = None if timeout is None else float(timeout)
        self._lock = threading.Lock()
        self._signal: bool | None = None
        self._explanation = ""
        self._subscribers = [
            rospy.Subscriber(self._topic, Bool, self._on_signal, queue_size=10),
            rospy.Subscriber(f"{self._topic}/reason", String, self._on_reason, queue_size=10),
        ]

    def execute(self, userdata: Any) -> str:
        """Waits for an unread signal."""
        topic = rospy.resolve_name(self._topic)
        if self._timeout_s is not None and not self._is_published():
            limit_s = start_timeout()
            report = WaitReport(f"a publisher of topic '{topic}'", limit_s)

            def is_published() -> bool:
                report.remind()
                return self._is_published()

            if not self.wait_until(is_published, limit_s):
                return self.fail(f"no node publishes topic '{topic}' after {limit_s:g} s; start its publisher")
        if not self.wait_until(lambda: self._signal is not None, self._timeout_s):
            publishers = self._subscribers[0].get_num_connections()
            return self.fail(
                f"no signal came on topic '{topic}' within {self._timeout_s} s; "
                f"the logs of its {publishers} publishers give the reason"
            )
        with self._lock:
            signal, self._signal = self._signal, None
        try:
            renew = rospy.resolve_name(f"{self._topic}/renew")
            if rosservice.get_service_uri(renew) is not None:
                response = call_service(
                    rospy.ServiceProxy(renew, Trigger), TriggerRequest(), self._timeout_s or math.inf
                )
                signal, self._explanation = response.success, response.message
        except (CallError, rosservice.ROSServiceException) as error:
            return self.fail(str(error))
        if signal:
            return self.succeed()
        self.wait_until(lambda: bool(self._explanation), REASON_WAIT_S)
        because = f": {self._explanation}" if self._explanation else ""
        return self.fail(f"topic '{topic}' signalled failure{because}")

    def _is_published(self) -> bool:
        """Returns whether a node publishes the topic, or has done so."""
        return self._signal is not None or self._subscribers[0].get_num_connections() > 0

    def _on_signal(self, message: Bool) -> None:
        with self._lock:
            self._signal = bool(message.data)

    def _on_reason(self, message: String) -> None:
        self._explanation = message.data
