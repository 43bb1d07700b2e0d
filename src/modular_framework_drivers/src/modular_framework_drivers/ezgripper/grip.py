# SPDX-License-Identifier: BSD-3-Clause
"""Switches the gripper's motor between position control and a constant torque against an object.

In position control, a motor whose fingers are blocked by an object pushes with its maximum torque until it shuts down
with an overload, and loses an object that moves away. Therefore, if the fingers have stood still short of their goal
(a stall), the motor switches to a constant torque towards the goal, which it can sustain and with which the fingers
follow the object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum


@dataclass(frozen=True, slots=True)
class Goal:
    """Holds the goal of a motion.

    Attributes:
        number: Number of the goal, by which a client recognises its own goal.
        position: Goal position of the knuckle joint [rad].
        torque: Maximum torque in servo units, 0 to 1023.
    """

    number: int
    position: float
    torque: int


@dataclass(frozen=True, slots=True)
class Drive:
    """Holds a command to the motor.

    Attributes:
        position: Set point of the position control [rad]; None for torque control.
        torque: Maximum torque in position control, commanded torque in torque control [servo units].
        direction: Direction of the torque: 1 closes, -1 opens.
    """

    position: float | None
    torque: int
    direction: int = 1


@dataclass(frozen=True, slots=True)
class GripRules:
    """Holds the thresholds for reached goals and stalled fingers.

    Attributes:
        position_tolerance: Maximum distance to a reached goal [rad].
        settle_s: Minimum time at rest at a reached goal [s].
        stall_s: Minimum time at rest of stalled fingers [s].
        still: Maximum displacement of fingers at rest [rad].
        hold_torque: Maximum torque for holding an object, which the motor can sustain [servo units].
        stale_s: Maximum time between two measured positions that counts as rest [s].
    """

    position_tolerance: float = 0.03
    settle_s: float = 0.1
    stall_s: float = 0.25
    still: float = 0.01
    hold_torque: int = 400
    stale_s: float = 0.1


class Motion(Enum):
    """State of the fingers: moving, at the goal, or holding an object after a stall."""

    MOVING = "moving"
    REACHED = "reached"
    HOLDING = "holding"


class Grip:
    """Computes motor commands from goals and measured positions; the state machine of the fingers.

    Args:
        rules: Thresholds for reached goals and stalled fingers.
        goal: Initial goal.
    """

    def __init__(self, rules: GripRules, goal: Goal) -> None:
        self._rules = rules
        self.goal = goal
        self.motion = Motion.MOVING
        self._direction = 1
        self._release_position = goal.position
        self._rest_position = math.nan
        self._still_s = 0.0
        self._updated_s = -math.inf

    def retarget(self, goal: Goal, position: float, time_s: float) -> None:
        """Sets a new goal.

        Fingers that hold an object keep holding it with the torque of the new goal, unless the goal opens them by more
        than the tolerance. Thus, a goal at the current position, as sent by a controller that holds its joints, does
        not release the object.

        Args:
            goal: New goal.
            position: Measured position [rad].
            time_s: Current time [s].
        """
        previous_goal, self.goal = self.goal, goal
        goal_distance, tolerance = (goal.position - position) * self._direction, self._rules.position_tolerance
        if self.motion is Motion.HOLDING and goal_distance >= -tolerance:
            margin = tolerance if goal_distance <= tolerance else 0.0
            self._release_position = goal.position + self._direction * margin
            return
        reversed_direction = (goal.position - position) * (previous_goal.position - position) < 0.0
        jumped = abs(goal.position - previous_goal.position) > self._rules.position_tolerance
        if self.motion is not Motion.MOVING or reversed_direction or jumped:
            self._start_motion(position, time_s)

    def stop(self, position: float) -> None:
        """Makes the measured position [rad] the goal of moving fingers; fingers at rest keep their goal."""
        if self.motion is Motion.MOVING:
            self.goal = replace(self.goal, position=position)

    def update(self, position: float, time_s: float) -> Drive:
        """Returns the motor command for fingers at `position` [rad] at time `time_s` [s]."""
        self._still_s += min(time_s - self._updated_s, self._rules.stale_s)
        self._updated_s = time_s
        if not abs(position - self._rest_position) <= self._rules.still:
            self._rest_position, self._still_s = position, 0.0
        error = self.goal.position - position
        arrived = abs(error) <= self._rules.position_tolerance
        released = self.motion is Motion.HOLDING and (self._release_position - position) * self._direction <= 0.0
        pushed_away = self.motion is Motion.REACHED and not arrived
        if released or pushed_away:
            self._start_motion(position, time_s)
        elif self.motion is Motion.MOVING and arrived and self._still_s >= self._rules.settle_s:
            self.motion = Motion.REACHED
        elif self.motion is Motion.MOVING and not arrived and self._still_s >= self._rules.stall_s:
            self.motion, self._direction = Motion.HOLDING, 1 if error > 0.0 else -1
            self._release_position = self.goal.position
        return self._drive()

    def _start_motion(self, position: float, time_s: float) -> None:
        self.motion = Motion.MOVING
        self._rest_position, self._still_s, self._updated_s = position, 0.0, time_s

    def _drive(self) -> Drive:
        hold_torque = min(self.goal.torque, self._rules.hold_torque)
        match self.motion:
            case Motion.HOLDING:
                return Drive(None, hold_torque, self._direction)
            case Motion.REACHED:
                return Drive(self.goal.position, hold_torque)
            case Motion.MOVING:
                return Drive(self.goal.position, self.goal.torque)
        raise ValueError(f"unknown motion {self.motion}")


class StandstillDetector:
    """Detects fingers at rest.

    A single small velocity also occurs when the fingers reverse, so all velocities within a time must be small.

    Args:
        max_speed: Maximum speed of fingers at rest [rad/s].
        duration_s: Minimum time below this speed [s].
    """

    def __init__(self, max_speed: float, duration_s: float) -> None:
        self._max_speed = max_speed
        self._duration_s = duration_s
        self._since_s = math.inf

    def update(self, velocity: float, time_s: float) -> bool:
        """Adds the velocity [rad/s] measured at `time_s` [s]; returns whether the fingers are at rest."""
        self._since_s = min(self._since_s, time_s) if abs(velocity) < self._max_speed else math.inf
        return time_s - self._since_s >= self._duration_s
