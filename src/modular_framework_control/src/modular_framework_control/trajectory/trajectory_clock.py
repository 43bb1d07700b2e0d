# SPDX-License-Identifier: BSD-3-Clause
"""The clock of a trajectory: control loop time, scaled with the robot's speed scaling.

A paused robot, or a robot with its speed slider at 10 %, cannot follow a trajectory at the planned speed, so the clock
of the trajectory runs at the robot's speed scaling. The clock slows down at once and speeds up gradually, so that a
resuming robot starts smoothly.
"""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.trajectory.joint_trajectory import ACCELERATION, VELOCITY, Array

RATE_RISE_PER_S = 2.0


class TrajectoryClock:
    """A clock that never runs faster than the control loop's clock.

    Args:
        handles: Speed scaling of the joints; the minimum factor sets the rate.

    Attributes:
        now_s: Current time; equals loop time until the clock is slowed.
        rate: Seconds per second of loop time, 0 to 1.
    """

    __slots__ = ("now_s", "rate", "_handles", "_loop_s", "_lag_s")

    def __init__(self, handles: Sequence[SpeedScalingHandle] = ()) -> None:
        self._handles = handles
        self.start(0.0)

    def start(self, loop_s: float) -> None:
        """Sets the clock to loop time `loop_s`."""
        self.now_s = self._loop_s = loop_s
        self._lag_s = 0.0
        self.rate = self._max_rate()

    def advance(self, loop_s: float) -> None:
        """Advances the clock to loop time `loop_s`."""
        elapsed_s = loop_s - self._loop_s
        self._loop_s = loop_s
        self.rate = min(self._max_rate(), self.rate + RATE_RISE_PER_S * elapsed_s)
        if self.rate == 1.0:
            self.now_s = loop_s - self._lag_s
            return
        self.now_s += self.rate * elapsed_s
        self._lag_s = loop_s - self.now_s

    def time_at(self, loop_s: float) -> float:
        """Returns the clock's time at loop time `loop_s`, assuming full rate from now on."""
        return loop_s - self._lag_s

    def expected_time_at(self, loop_s: float) -> float:
        """Returns the clock's time at loop time `loop_s`, assuming the current rate."""
        return (
            self.now_s + self.rate * (self.time_at(loop_s) - self.now_s) if self.rate != 1.0 else self.time_at(loop_s)
        )

    def scale_state(self, planned: Array) -> Array:
        """Scales velocities and accelerations of a planned state, shape (3, joints), by the rate, in place."""
        if self.rate != 1.0:
            planned[VELOCITY] *= self.rate
            planned[ACCELERATION] *= self.rate * self.rate
        return planned

    def _max_rate(self) -> float:
        return min((min(max(0.0, handle.factor), 1.0) for handle in self._handles), default=1.0)
