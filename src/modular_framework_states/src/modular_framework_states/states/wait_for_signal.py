# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task wait until another component says that it has done its part."""

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
    """Waits for one Bool on a topic; True is the positive outcome.

    The topic is listened to from the moment the state is made: the latest signal that was not read yet counts, however
    early it came. A component may explain a False by a text on ``<topic_name>/reason`` (std_msgs/String).

    A latched signal may be left from an earlier task. A component that offers the service ``<topic_name>/renew``
    (std_srvs/Trigger) makes it true again, or answers why it cannot; its answer counts instead of the signal.

    A component that is still starting has the time that every node has for another one at the start, the parameter
    ``/start_timeout``; `timeout` counts from when it publishes the topic.

    Args:
        topic_name: Topic of the signal (std_msgs/Bool).
        timeout: Longest wait [s]; None waits without limit, until stopped.
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
        """Waits for a signal that was not read yet."""
        topic = rospy.resolve_name(self._topic)
        if self._timeout_s is not None and not self._is_published():
            limit_s = start_timeout()
            report = WaitReport(f"a publisher of topic '{topic}'", limit_s)

            def is_published() -> bool:
                report.remind()
                return self._is_published()

            if not self.wait_until(is_published, limit_s):
                return self.fail(f"no node publishes topic '{topic}' after {limit_s:g} s, start the one that does")
        if not self.wait_until(lambda: self._signal is not None, self._timeout_s):
            publishers = self._subscribers[0].get_num_connections()
            return self.fail(
                f"no signal came on topic '{topic}' within {self._timeout_s} s; "
                f"the log of its {publishers} publishers says what they wait for"
            )
        with self._lock:
            signal, self._signal = self._signal, None
        try:
            renew = rospy.resolve_name(f"{self._topic}/renew")
            if rosservice.get_service_uri(renew) is not None:
                answer = call_service(rospy.ServiceProxy(renew, Trigger), TriggerRequest(), self._timeout_s or math.inf)
                signal, self._explanation = answer.success, answer.message
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
