# SPDX-License-Identifier: BSD-3-Clause
"""A state that checks the messages of a topic until a condition is violated or has held often enough."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Any

import rospy

import smach
from smach_ros.waiting import POLL_PERIOD_S, RosTimeLimit, going_down, seconds

__all__ = ["MonitorState"]


class MonitorState(smach.State):
    """Outcomes: valid (condition true ``max_checks`` times), invalid (false once), preempted.

    Attributes:
        reason: Reason for the outcomes invalid and preempted; "" otherwise.
    """

    def __init__(
        self,
        topic: str,
        msg_type: Any,
        cond_cb: Callable[[Any, Any], object],
        max_checks: int = -1,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
        timeout: rospy.Duration | None = None,
    ) -> None:
        """Creates the state.

        Args:
            topic: Name of the topic.
            msg_type: Message class of the topic.
            cond_cb: Condition, called with (userdata, message); a false value or an error gives the outcome invalid.
            max_checks: Number of true results for the outcome valid; -1 for no limit.
            input_keys: Userdata keys that are read.
            output_keys: Userdata keys that are written.
            io_keys: Userdata keys that are read and written.
            timeout: Maximum duration [ROS time], after which the outcome is invalid; None for no limit.

        Raises:
            smach.InvalidStateError: An argument is invalid.
        """
        super().__init__(("valid", "invalid", "preempted"), input_keys, output_keys, io_keys)
        if not hasattr(msg_type, "_md5sum"):
            raise smach.InvalidStateError(
                f"msg_type of '{topic}' must be the class of a message such as std_msgs.msg.Bool, got {msg_type!r}"
            )
        if not callable(cond_cb):
            raise smach.InvalidStateError(f"cond_cb of '{topic}' is a {type(cond_cb).__name__}; give a function")
        self._topic = topic
        self._msg_type = msg_type
        self._cond_cb = cond_cb
        self._max_checks = max_checks
        self._timeout_s = seconds("timeout", timeout)
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._checks = 0
        self._verdict: str | None = None
        self.reason = ""

    def execute(self, userdata: Any) -> str:
        """Checks messages until one decides the outcome."""
        self.reason = ""
        self._checks = 0
        self._verdict = None
        self._wake.clear()
        if self.preempt_requested():
            return self._handle_preempt()
        limit = RosTimeLimit(self._timeout_s)
        subscriber = rospy.Subscriber(self._topic, self._msg_type, self._check, callback_args=userdata)
        try:
            while self._verdict is None:
                if self.preempt_requested() or going_down():
                    return self._handle_preempt()
                if limit.over():
                    self._decide("invalid", f"no decision from '{self._topic}' within {self._timeout_s} s")
                self._wake.wait(POLL_PERIOD_S)
        finally:
            subscriber.unregister()
        return self._handle_preempt() if self.preempt_requested() else self._verdict

    def _check(self, message: Any, userdata: Any) -> None:
        """Evaluates the condition for a message; the first decision is final."""
        with self._lock:
            if self._verdict is not None:
                return
            try:
                holds = bool(self._cond_cb(userdata, message))
            except Exception as error:
                self._decide("invalid", f"the condition on '{self._topic}' raised {type(error).__name__}: {error}")
                smach.logerr(self.reason)
                return
            if not holds:
                self._decide("invalid", f"the condition on '{self._topic}' does not hold")
                return
            self._checks += 1
            if 0 < self._max_checks <= self._checks:
                self._decide("valid", "")

    def _decide(self, verdict: str, reason: str) -> None:
        self.reason = reason
        self._verdict = verdict
        self._wake.set()

    def _handle_preempt(self) -> str:
        self.reason = f"stopped while monitoring '{self._topic}'"
        self.service_preempt()
        return "preempted"

    def request_preempt(self) -> None:
        """Requests the state to stop."""
        super().request_preempt()
        self._wake.set()
