# SPDX-License-Identifier: BSD-3-Clause
"""A state that polls a condition until it is true."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable
from typing import Any

import rospy

import smach
from smach_ros.waiting import RosTimeLimit, going_down, seconds

__all__ = ["ConditionState"]


class ConditionState(smach.State):
    """Outcomes: true, false (not true within the allowed checks or time), preempted."""

    def __init__(
        self,
        cond_cb: Callable[[Any], object],
        input_keys: Iterable[str] = (),
        poll_rate: rospy.Duration = rospy.Duration(0.05),  # noqa: B008 - never changed
        timeout: rospy.Duration | None = None,
        max_checks: int = 1,
    ) -> None:
        """Creates the state.

        Args:
            cond_cb: Condition, called with the userdata; a function of ``smach.cb_interface`` declares its own keys.
            input_keys: Userdata keys that are read.
            poll_rate: Period of the checks [wall time].
            timeout: Maximum duration [ROS time]; None for no limit.
            max_checks: Maximum number of checks; -1 for no limit.

        Raises:
            smach.InvalidStateError: An argument is invalid.
        """
        super().__init__(("true", "false", "preempted"), input_keys)
        if not callable(cond_cb):
            raise smach.InvalidStateError(f"cond_cb is a {type(cond_cb).__name__}; give a function")
        if not isinstance(max_checks, int) or (max_checks < 1 and max_checks != -1):
            raise smach.InvalidStateError(f"max_checks must be -1 (no limit) or at least 1, got {max_checks!r}")
        period_s = seconds("poll_rate", poll_rate)
        if period_s is None:
            raise smach.InvalidStateError("poll_rate must be a rospy.Duration, got None")
        declared: Any = cond_cb
        if smach.has_smach_interface(cond_cb):
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())
        self._cond_cb = cond_cb
        self._period_s = period_s
        self._timeout_s = seconds("timeout", timeout)
        self._max_checks = max_checks
        self._wake = threading.Event()

    def execute(self, userdata: Any) -> str:
        """Polls the condition until it is true or a limit is reached.

        Raises:
            smach.InvalidUserCodeError: The condition raised an error.
        """
        self._wake.clear()
        limit = RosTimeLimit(self._timeout_s)
        checks = 0
        while not (self.preempt_requested() or going_down()):
            if limit.over():
                return "false"
            if self._evaluate(userdata):
                return "true"
            checks += 1
            if checks == self._max_checks:
                return "false"
            self._wake.wait(self._period_s)
        self.service_preempt()
        return "preempted"

    def _evaluate(self, userdata: Any) -> bool:
        try:
            return bool(self._cond_cb(userdata))
        except Exception as error:
            raise smach.InvalidUserCodeError(
                f"condition {self._cond_cb!r} raised {type(error).__name__}: {error}\n{traceback.format_exc()}"
            ) from error

    def request_preempt(self) -> None:
        """Requests the state to stop."""
        super().request_preempt()
        self._wake.set()
