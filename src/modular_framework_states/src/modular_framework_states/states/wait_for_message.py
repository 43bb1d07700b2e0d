# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task wait for a message of any type."""
from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import roslib.message
import rospy

from modular_framework_core.framework_state import FrameworkState
from modular_framework_states.message_filling import difference

FOUND = "message"


class WaitForMessage(FrameworkState):
    """Waits for a message that is published after the state begins (or was latched), and may look at its fields.

    Args:
        topic_name: Topic.
        timeout: Longest wait [s]; None waits without limit.
        expect: Field to value, nested as the message is; other messages are passed over.
        outcomes: First positive, last negative.
        input_keys: Userdata that is read.
        output_keys: Userdata that is written.
        io_keys: Userdata that is read and written.
            ``message`` receives the message when it is listed.
    """

    def __init__(self, topic_name: str, timeout: float | None = None, expect: Mapping[str, Any] | None = None,
                 outcomes: Sequence[str] = ("success", "fail"),
                 input_keys: Sequence[str] = (), output_keys: Sequence[str] = (), io_keys: Sequence[str] = ()) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        if timeout is not None and not float(timeout) > 0.0:
            raise ValueError(f"WaitForMessage: timeout is {timeout} s, allowed is more than 0, or none for no limit")
        self._topic = str(topic_name)
        self._timeout_s = None if timeout is None else float(timeout)
        self._expected = dict(expect or {})
        self._lock = threading.Lock()
        self._found: list[Any] = []
        self._last_difference = ""

    def execute(self, userdata: Any) -> str:
        """Subscribes, waits and unsubscribes."""
        self._found, self._last_difference = [], ""
        subscriber = rospy.Subscriber(self._topic, rospy.AnyMsg, self._on_message, queue_size=10)
        try:
            arrived = self.wait_until(lambda: bool(self._found), self._timeout_s)
            publishers = subscriber.get_num_connections()
        finally:
            subscriber.unregister()
        if not arrived:
            if self.preempt_requested():
                return self.stopped()
            seen = self._last_difference or f"{publishers} publishers are connected"
            return self.fail(f"no message came on topic '{rospy.resolve_name(self._topic)}' within {self._timeout_s} s "
                             f"({seen})" if not self._expected else
                             f"no message as expected came on topic '{rospy.resolve_name(self._topic)}' within "
                             f"{self._timeout_s} s ({seen})")
        if FOUND in self.get_registered_output_keys():
            userdata[FOUND] = self._found[0]
        return self.succeed()

    def _on_message(self, raw: Any) -> None:
        kind = raw._connection_header["type"]
        message_type = roslib.message.get_message_class(kind)
        if message_type is None:
            self._last_difference = f"its type {kind} is not built in this workspace"
            return
        message = message_type()
        message.deserialize(raw._buff)
        with self._lock:
            self._last_difference = difference(message, self._expected)
            if not self._last_difference:
                self._found.append(message)
