# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task pause."""

from __future__ import annotations

from typing import Any, Unpack

import rospy

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative, Positive


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

    def execute(self, userdata: Any) -> str:
        """Waits."""
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
