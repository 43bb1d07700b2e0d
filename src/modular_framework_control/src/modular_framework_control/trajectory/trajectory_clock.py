# SPDX-License-Identifier: BSD-3-Clause
"""The clock of a trajectory: the time of the control loop, scaled with the speed of the robot.

A robot whose speed slider is at 10 %, or which is paused, cannot follow a trajectory at its planned speed. So the clock
of the trajectory runs at the robot's share of that speed. It slows down at once and speeds up gradually, so that a
robot that resumes starts without a jerk.
"""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.trajectory.joint_trajectory import ACCELERATION, VELOCITY, Array

RISE_PER_S = 2.0


class TrajectoryClock:
    """A clock that is never faster than that of the loop.

    Args:
        handles: speed scaling of the joints; the smallest factor sets the rate.

    Attributes:
        now_s: its time [s]; that of the loop as long as nothing slowed it.
        rate: its seconds per second of the loop, 0 to 1.
    """

    __slots__ = ("now_s", "rate", "_handles", "_loop_s", "_lag_s")

    def __init__(self, handles: Sequence[SpeedScalingHandle] = ()) -> None:
        self._handles = handles
        self.start(0.0)

    def start(self, loop_s: float) -> None:
        """Sets it to the loop's time [s]."""
        self.now_s = self._loop_s = loop_s
        self._lag_s = 0.0
        self.rate = self._allowed()

    def advance(self, loop_s: float) -> None:
        """Goes on to the loop's time `loop_s` [s]."""
        passed_s = loop_s - self._loop_s
        self._loop_s = loop_s
        self.rate = min(self._allowed(), self.rate + RISE_PER_S * passed_s)
        if self.rate == 1.0:
            self.now_s = loop_s - self._lag_s
            return
        self.now_s += self.rate * passed_s
        self._lag_s = loop_s - self.now_s

    def at(self, loop_s: float) -> float:
        """Its time [s] at another time of the loop [s], if it ran at full rate from now to then."""
        return loop_s - self._lag_s

    def expected_at(self, loop_s: float) -> float:
        """Its time [s] at another time of the loop [s], if it ran at the rate of now all along."""
        return self.now_s + self.rate * (self.at(loop_s) - self.now_s) if self.rate != 1.0 else self.at(loop_s)

    def slowed(self, planned: Array) -> Array:
        """The planned state, shape (3, joints), with the velocities and accelerations of now; `planned` is changed."""
        if self.rate != 1.0:
            planned[VELOCITY] *= self.rate
            planned[ACCELERATION] *= self.rate * self.rate
        return planned

    def _allowed(self) -> float:
        return min((min(max(0.0, handle.factor), 1.0) for handle in self._handles), default=1.0)
