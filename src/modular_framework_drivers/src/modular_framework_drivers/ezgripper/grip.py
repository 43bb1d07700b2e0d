# SPDX-License-Identifier: BSD-3-Clause
"""Decides how the gripper's motor is driven: to a position, or with a constant torque against an object.

In position control a motor whose fingers meet an object pushes with all the torque it may use until it shuts down with
an overload, and it lets go when the object gives way. So, when the fingers have stood still for some time short of
their goal (a stall), the motor is switched to a constant torque towards the goal. It can sustain that torque, and the
fingers follow the object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of a motion.

    Attributes:
        number: counts the goals, so that a client recognises its own.
        position: of the knuckle joint [rad].
        torque: largest torque [units of the servo, 0 to 1023].
    """

    number: int
    position: float
    torque: int


@dataclass(frozen=True, slots=True)
class Drive:
    """Command to the motor.

    Attributes:
        position: set point of the position control [rad]; None for torque control.
        torque: largest torque in position control, the torque itself in torque control [units of the servo].
        direction: of the torque: 1 closes, -1 opens.
    """

    position: float | None
    torque: int
    direction: int = 1


@dataclass(frozen=True, slots=True)
class GripRules:
    """Thresholds that decide when a goal is reached and when the fingers have stalled.

    Attributes:
        position_tolerance: largest distance from the goal at which it counts as reached [rad].
        settle_s: for how long the fingers must stand still at the goal [s].
        stall_s: for how long they must stand still short of the goal to count as stalled [s].
        still: largest motion that counts as standing still [rad].
        hold_torque: largest torque to hold an object with; the motor can sustain it [units of the servo].
        stale_s: of the time between two measured positions no more than this counts as standing still [s].
    """

    position_tolerance: float = 0.03
    settle_s: float = 0.1
    stall_s: float = 0.25
    still: float = 0.01
    hold_torque: int = 400
    stale_s: float = 0.1


class Motion(Enum):
    """State of the fingers: on their way, at the goal, or stalled against an object that they hold."""

    MOVING = "moving"
    REACHED = "reached"
    HOLDING = "holding"


class Grip:
    """State machine of the fingers: from goals and measured positions to commands for the motor.

    Args:
        rules: when a goal is reached, when the fingers have stalled.
        goal: the first one.
    """

    def __init__(self, rules: GripRules, goal: Goal) -> None:
        self._rules = rules
        self.goal = goal
        self.motion = Motion.MOVING
        self._direction = 1
        self._free_beyond = goal.position
        self._rest_position = math.nan
        self._still_s = 0.0
        self._updated_s = -math.inf

    def retarget(self, goal: Goal, position: float, time_s: float) -> None:
        """Sets a new goal.

        Fingers that hold an object keep holding it, with the torque of the new goal, unless the goal opens them by more
        than the tolerance. A goal at the present position, such as a controller sends to hold its joints, does not
        release the object.

        Args:
            goal: replaces the present one.
            position: measured [rad].
            time_s: now [s].
        """
        before, self.goal = self.goal, goal
        ahead, tolerance = (goal.position - position) * self._direction, self._rules.position_tolerance
        if self.motion is Motion.HOLDING and ahead >= -tolerance:
            slack = tolerance if ahead <= tolerance else 0.0
            self._free_beyond = goal.position + self._direction * slack
            return
        turned = (goal.position - position) * (before.position - position) < 0.0
        jumped = abs(goal.position - before.position) > self._rules.position_tolerance
        if self.motion is not Motion.MOVING or turned or jumped:
            self._begin(position, time_s)

    def stop(self, position: float) -> None:
        """Makes the measured position [rad] the goal of moving fingers; those that stand or hold an object are left."""
        if self.motion is Motion.MOVING:
            self.goal = replace(self.goal, position=position)

    def update(self, position: float, time_s: float) -> Drive:
        """Returns the command to the motor for fingers that are at `position` [rad] at `time_s` [s]."""
        self._still_s += min(time_s - self._updated_s, self._rules.stale_s)
        self._updated_s = time_s
        if not abs(position - self._rest_position) <= self._rules.still:
            self._rest_position, self._still_s = position, 0.0
        error = self.goal.position - position
        arrived = abs(error) <= self._rules.position_tolerance
        free_again = self.motion is Motion.HOLDING and (self._free_beyond - position) * self._direction <= 0.0
        pushed_away = self.motion is Motion.REACHED and not arrived
        if free_again or pushed_away:
            self._begin(position, time_s)
        elif self.motion is Motion.MOVING and arrived and self._still_s >= self._rules.settle_s:
            self.motion = Motion.REACHED
        elif self.motion is Motion.MOVING and not arrived and self._still_s >= self._rules.stall_s:
            self.motion, self._direction = Motion.HOLDING, 1 if error > 0.0 else -1
            self._free_beyond = self.goal.position
        return self._drive()

    def _begin(self, position: float, time_s: float) -> None:
        self.motion = Motion.MOVING
        self._rest_position, self._still_s, self._updated_s = position, 0.0, time_s

    def _drive(self) -> Drive:
        held = min(self.goal.torque, self._rules.hold_torque)
        match self.motion:
            case Motion.HOLDING:
                return Drive(None, held, self._direction)
            case Motion.REACHED:
                return Drive(self.goal.position, held)
            case Motion.MOVING:
                return Drive(self.goal.position, self.goal.torque)
        raise ValueError(f"unknown motion {self.motion}")


class StandstillDetector:
    """Detects that the fingers stand still.

    One small velocity is not enough, because fingers that reverse their direction have one too: all velocities
    measured over a time must be small.

    Args:
        max_speed: largest speed that counts as standing still [rad/s].
        duration_s: for how long it must not be exceeded [s].
    """

    def __init__(self, max_speed: float, duration_s: float) -> None:
        self._max_speed = max_speed
        self._duration_s = duration_s
        self._since_s = math.inf

    def update(self, velocity: float, time_s: float) -> bool:
        """Adds the velocity [rad/s] measured at `time_s` [s]; returns whether the fingers stand still."""
        self._since_s = min(self._since_s, time_s) if abs(velocity) < self._max_speed else math.inf
        return time_s - self._since_s >= self._duration_s
