# SPDX-License-Identifier: BSD-3-Clause
"""Decides what the gripper's motor has to do: go somewhere, stay there, or go on squeezing what is in the way.

A gripper that meets an object must not go on pushing in position control: the motor would try with all it may until it
shuts down with an overload, or would let go when the object gives way. So, once the fingers have stood still for a
while short of their goal, the motor gets a constant torque towards it, which does no harm and follows the object.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum


class Motion(Enum):
    """What the fingers do."""

    MOVING = "moving"
    REACHED = "reached"
    HOLDING = "holding"


@dataclass(frozen=True, slots=True)
class Goal:
    """Where to go.

    Attributes:
        number: counts the goals, so that whoever gave one can tell when it is the one worked on.
        position: of the knuckle joint [rad].
        torque: greatest torque [units of the servo, 0 to 1023].
    """

    number: int
    position: float
    torque: int


@dataclass(frozen=True, slots=True)
class Drive:
    """What the motor is told.

    Attributes:
        position: to control to [rad]; None when it applies a torque instead.
        torque: greatest torque, or the one to apply [units of the servo].
        direction: of the torque: 1 closes, -1 opens.
    """

    position: float | None
    torque: int
    direction: int = 1


@dataclass(frozen=True, slots=True)
class GripRules:
    """When the fingers count as arrived or held up.

    Attributes:
        position_tolerance: distance that counts as arrived [rad].
        settle_s: arrived ones have been still for so long [s].
        stall_s: held up ones have been still for so long [s].
        still: still is who moves less than this [rad].
        hold_torque: greatest torque to hold something with, which the motor endures for long [units of the servo].
    """

    position_tolerance: float = 0.03
    settle_s: float = 0.1
    stall_s: float = 0.25
    still: float = 0.01
    hold_torque: int = 400


class Grip:
    """The motion of the fingers; told the measured position every now and then, it says what the motor has to do.

    Args:
        rules: when is arrived, when held up.
        goal: to begin with.
    """

    def __init__(self, rules: GripRules, goal: Goal) -> None:
        self._rules = rules
        self.goal = goal
        self.motion = Motion.MOVING
        self._direction = 1
        self._free_beyond = goal.position
        self._rest_position = math.nan
        self._rest_since_s = 0.0

    def retarget(self, goal: Goal, position: float, time_s: float) -> None:
        """Take a new goal.

        Whoever holds something goes on holding it, with the new goal's torque, unless the goal is to let go; to stay
        where one is, as a controller commands that holds its joints, is not.

        Args:
            goal: where to go now.
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
        """Stop moving fingers; those that stand, or hold something, go on with that."""
        if self.motion is Motion.MOVING:
            self.goal = replace(self.goal, position=position)

    def update(self, position: float, time_s: float) -> Drive:
        """What the motor has to do with the fingers at `position` [rad], at `time_s` [s]."""
        if not abs(position - self._rest_position) <= self._rules.still:
            self._rest_position, self._rest_since_s = position, time_s
        still_s = time_s - self._rest_since_s
        error = self.goal.position - position
        arrived = abs(error) <= self._rules.position_tolerance
        free_again = self.motion is Motion.HOLDING and (self._free_beyond - position) * self._direction <= 0.0
        pushed_away = self.motion is Motion.REACHED and not arrived
        if free_again or pushed_away:
            self._begin(position, time_s)
        elif self.motion is Motion.MOVING and arrived and still_s >= self._rules.settle_s:
            self.motion = Motion.REACHED
        elif self.motion is Motion.MOVING and not arrived and still_s >= self._rules.stall_s:
            self.motion, self._direction = Motion.HOLDING, 1 if error > 0.0 else -1
            self._free_beyond = self.goal.position
        return self._drive()

    def _begin(self, position: float, time_s: float) -> None:
        self.motion = Motion.MOVING
        self._rest_position, self._rest_since_s = position, time_s

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
    """Whether fingers stand; that they are slow once is not enough, so they are where they turn round too.

    Args:
        slow: who stands is slower than this [rad/s].
        duration_s: and has been all the time for so long [s].
    """

    def __init__(self, slow: float, duration_s: float) -> None:
        self._slow = slow
        self._duration_s = duration_s
        self._since_s = math.inf

    def update(self, velocity: float, time_s: float) -> bool:
        """Take a measured velocity [rad/s] of `time_s` [s]; returns whether the fingers stand."""
        self._since_s = min(self._since_s, time_s) if abs(velocity) < self._slow else math.inf
        return time_s - self._since_s >= self._duration_s
