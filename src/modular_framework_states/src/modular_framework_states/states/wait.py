# SPDX-License-Identifier: BSD-3-Clause
"""A state that waits for a time."""

from __future__ import annotations

from typing import Any, Unpack

import rospy

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative, Positive
from modular_framework_ros.calls import CallError
from modular_framework_ros.simulated_time import SimulatedTime

STEP_S = 0.5


class Wait(FrameworkState):
    """Waits for a duration on the ROS clock: simulated time in simulation.

    Args:
        duration: Duration [s].
        timeout: Maximum wait if the clock stops [s of real time]; None for three times the duration plus ten
            seconds.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, duration: NotNegative, timeout: Positive | None = None, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._duration_s = float(duration)
        self._timeout_s = 3.0 * self._duration_s + 10.0 if timeout is None else float(timeout)

        self._time = SimulatedTime()

    def execute(self, userdata: Any) -> str:
        """Waits until the duration has passed."""
        if self._time.enabled:
            return self._wait_in_held_time()
        start_time = rospy.Time.now()
        if self.wait_until(lambda: (rospy.Time.now() - start_time).to_sec() >= self._duration_s, self._timeout_s):
            return self.succeed()
        if self.preempt_requested():
            return self.stopped()
        passed = (rospy.Time.now() - start_time).to_sec()
        return self.fail(
            f"only {passed:.2f} of {self._duration_s} s passed on the ROS clock within "
            f"{self._timeout_s:.1f} s; is the simulation paused or slow?"
        )

    def _wait_in_held_time(self) -> str:
        """Advances simulated time in short steps, so that a stop request is noticed."""
        passed_s = 0.0
        while passed_s < self._duration_s and not self.stop_requested():
            step_s = min(STEP_S, self._duration_s - passed_s)
            try:
                self._time.sleep(step_s)
            except CallError as error:
                return self.fail(f"{passed_s:.2f} of {self._duration_s} s passed: {error}")
            passed_s += step_s
        return self.stopped() if self.stop_requested() else self.succeed()
