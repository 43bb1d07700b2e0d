# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task pause."""

from __future__ import annotations

from typing import Any, Unpack

import rospy

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative, Positive
from modular_framework_ros.calls import CallError
from modular_framework_ros.simulated_time import SimulatedTime

PIECE_S = 0.5


class Wait(FrameworkState):
    """Waits for some time of the robot's clock: simulated time in simulation.

    Args:
        duration: How long [s].
        timeout: Longest wait of wall time [s], for a clock that stands still; None waits three times the duration and
            ten seconds more.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, duration: NotNegative, timeout: Positive | None = None, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._duration_s = float(duration)
        self._timeout_s = 3.0 * self._duration_s + 10.0 if timeout is None else float(timeout)

        self._time = SimulatedTime()

    def execute(self, userdata: Any) -> str:
        """Waits."""
        if self._time.enabled:
            return self._wait_in_held_time()
        begun = rospy.Time.now()
        if self.wait_until(lambda: (rospy.Time.now() - begun).to_sec() >= self._duration_s, self._timeout_s):
            return self.succeed()
        if self.preempt_requested():
            return self.stopped()
        passed = (rospy.Time.now() - begun).to_sec()
        return self.fail(
            f"only {passed:.2f} of {self._duration_s} s passed on the robot's clock within "
            f"{self._timeout_s:.1f} s; is the simulation paused or slow?"
        )

    def _wait_in_held_time(self) -> str:
        """Asks for simulated time to pass, in pieces, so that a request to stop is noticed."""
        passed_s = 0.0
        while passed_s < self._duration_s and not self.stop_requested():
            piece_s = min(PIECE_S, self._duration_s - passed_s)
            try:
                self._time.sleep(piece_s)
            except CallError as error:
                return self.fail(f"{passed_s:.2f} of {self._duration_s} s passed: {error}")
            passed_s += piece_s
        return self.stopped() if self.stop_requested() else self.succeed()
