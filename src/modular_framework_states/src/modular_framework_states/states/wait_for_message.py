# SPDX-License-Identifier: BSD-3-Clause
"""A state that waits for a message of any type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Unpack

import roslib.message
import rospy

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_ros.calls import MotionTimeout
from modular_framework_states.message_filling import FillingError, difference, with_userdata
from modular_framework_states.responses import MessageFields

MESSAGE_KEY = "message"


class WaitForMessage(FrameworkState):
    """Waits for a message published after the state starts, or latched, and optionally checks its fields.

    Args:
        topic_name: Name of the topic.
        timeout: Maximum wait [s]; None for no limit.
        expect: Field to expected value, nested like the message; other messages are ignored. The string
            ``userdata.<key>`` is replaced by the userdata at that key, and ``userdata.<key>.<field>`` by a field of it.
        **keys: Outcomes and userdata keys of any state; the output key ``message`` receives the message.
    """

    def __init__(
        self,
        topic_name: str,
        timeout: Positive | None = None,
        expect: MessageFields | None = None,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._topic = str(topic_name)
        self._timeout_s = None if timeout is None else float(timeout)
        self._expected = dict(expect or {})
        self._wanted: dict[str, Any] = {}
        self._found: list[Any] = []
        self._last_difference = ""

    def execute(self, userdata: Any) -> str:
        """Waits for a publisher, subscribes with its type, waits for a message and unsubscribes."""
        self._found, self._last_difference = [], "nobody publishes it"
        try:
            self._wanted = with_userdata(self._expected, userdata)
        except FillingError as error:
            return self.fail(f"message of topic '{self._topic}': {error}")
        timeout = None if self._timeout_s is None else MotionTimeout(self._timeout_s)
        name = rospy.resolve_name(self._topic)
        arrived = self._wait(lambda: bool(published_type(name)), timeout, 0.1) and self._receive(name, timeout)
        if not arrived:
            problem = "no message as expected" if self._expected else "no message"
            return self.fail(f"{problem} came on topic '{name}' within {self._timeout_s} s ({self._last_difference})")
        if MESSAGE_KEY in self.get_registered_output_keys():
            userdata[MESSAGE_KEY] = self._found[0]
        return self.succeed()

    def _receive(self, name: str, timeout: MotionTimeout | None) -> bool:
        """Subscribes with the type of the publisher, since all subscribers of a node to a topic share one type."""
        kind = published_type(name)
        message_type = roslib.message.get_message_class(kind)
        if message_type is None:
            self._last_difference = f"its type {kind or 'is not known any more, and'} is not built in this workspace"
            return False
        self._last_difference = "it has a publisher, but no message was sent"
        subscriber = rospy.Subscriber(name, message_type, self._on_message, queue_size=10)
        try:
            return self._wait(lambda: bool(self._found), timeout)
        finally:
            subscriber.unregister()

    def _wait(self, condition: Callable[[], bool], timeout: MotionTimeout | None, period_s: float = 0.02) -> bool:
        def is_over() -> bool:
            return condition() or (timeout is not None and timeout.is_exceeded())

        return self.wait_until(is_over, None, period_s) and condition()

    def _on_message(self, message: Any) -> None:
        self._last_difference = difference(message, self._wanted)
        if not self._last_difference:
            self._found.append(message)


def published_type(name: str) -> str:
    """Returns the message type of a topic; "" if no node publishes it.

    Args:
        name: Resolved name of the topic.
    """
    return next((str(kind) for topic, kind in rospy.get_published_topics() if topic == name and kind != "*"), "")
