# SPDX-License-Identifier: BSD-3-Clause
"""Checks every position command before it is sent to the arm.

A command that is no number, lies outside a joint's range or is far from the last one is refused; the arm brakes and
holds. One that is only faster, or accelerates more, than a joint may is followed as fast as the joint may; so is one
beyond a soft limit, or by as little beyond the range as trajectory controllers allow, up to that limit. A joint that
stands outside its range may stay there and come back.

The limits are those of all hardware (modular_framework_control.hardware_interface.joint_limits). Their guard replaces a
command by the nearest one allowed, which does not do here: a real arm must not drive to the end of its range because a
controller went wrong, and it stops itself hard when its speed is to change at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_control.hardware_interface.joint_limit_parameters import JointLimits, SoftJointLimits
from modular_framework_control.hardware_interface.joint_limits import soft_velocities
from modular_framework_control.trajectory.motion_limits import CURVE_MARGIN
from modular_framework_control.trajectory.stop_motion import FOLLOWING_LAG_S, SHARP_BRAKING_FRACTION

_SLACK = 1e-6  # tolerance for rounding [rad], and as a share of a limit


@dataclass(frozen=True, slots=True)
class CheckedJoint:
    """A joint with its limits.

    Attributes:
        name: of the joint.
        limits: of its position [rad], velocity [rad/s] and acceleration [rad/s^2]; all finite.
        soft: its soft limits, if any.
    """

    name: str
    limits: JointLimits
    soft: SoftJointLimits | None = None

    def velocity_range(self, position: float, period_s: float) -> tuple[float, float]:
        """Smallest and largest velocity at `position` [rad] in a cycle of `period_s` [s].

        So slow that the joint can stop within its range.
        """
        limits = self.limits
        slowest, fastest = -limits.max_velocity, limits.max_velocity
        if self.soft is not None:
            slowest, fastest = soft_velocities(position, limits, self.soft)
        below, above = max(position - limits.min_position, 0.0), max(limits.max_position - position, 0.0)
        return (
            max(slowest, -_closing_speed(below, limits.max_acceleration, period_s)),
            min(fastest, _closing_speed(above, limits.max_acceleration, period_s)),
        )


class CommandCheck:
    """The commands that go to the arm.

    Args:
        joints: in the order of the commands.
        max_jump: largest distance between a command and what was last sent [rad].

    Attributes:
        sent: what is to be sent [rad]; changed by `admit` and `reset`.
    """

    def __init__(self, joints: Sequence[CheckedJoint], max_jump: float) -> None:
        self._joints = tuple(joints)
        self._max_jump = max_jump
        self.sent = [0.0] * len(self._joints)
        self._velocities = [0.0] * len(self._joints)
        self._targets = [0.0] * len(self._joints)

    def reset(self, positions: Sequence[float]) -> None:
        """Restarts from an arm at rest at `positions` [rad]."""
        self.sent = list(positions)
        self._targets = list(positions)
        self._velocities = [0.0] * len(self._joints)

    def rest_after(self, index: int, position: float, velocity: float) -> float:
        """Returns where a joint at `position` [rad] with `velocity` [rad/s] comes to rest if it brakes now [rad]."""
        joint = self._joints[index]
        lowest, highest = joint.limits.range_from(position)
        way = velocity * FOLLOWING_LAG_S + math.copysign(_braking_distance(velocity, joint), velocity)
        return min(max(position + way, lowest), highest)

    def admit(self, commands: Sequence[float], period_s: float) -> str:
        """Sets `sent` to the command for the arm.

        Args:
            commands: positions [rad].
            period_s: time since the last call [s].

        Returns:
            "", or why the commands were refused; `sent` then brings the arm to rest.
        """
        reason = self._reason_to_refuse(commands)
        if period_s <= 0.0:
            return reason
        for index, joint in enumerate(self._joints):
            limits = joint.limits
            if reason:
                self._brake(index, limits.max_acceleration * period_s, period_s)
            else:
                lowest, highest = limits.range_from(self.sent[index])
                self._approach(index, min(max(commands[index], lowest), highest), joint, period_s)
        return reason

    def _reason_to_refuse(self, commands: Sequence[float]) -> str:
        for command, sent, velocity, joint in zip(commands, self.sent, self._velocities, self._joints, strict=True):
            limits = joint.limits
            if not math.isfinite(command):
                return f"joint '{joint.name}': command {command} is no position; the arm holds"
            lowest, highest = limits.range_from(sent)
            if not lowest - CURVE_MARGIN <= command <= highest + CURVE_MARGIN:
                return (
                    f"joint '{joint.name}': command {command:.6g} rad is outside its range "
                    f"[{limits.min_position:.6g}, {limits.max_position:.6g}] rad; the arm holds"
                )
            if abs(command - sent) > self._max_jump + _braking_distance(velocity, joint):
                return (
                    f"joint '{joint.name}': command {command:.6g} rad is {abs(command - sent):.3g} rad away from "
                    f"{sent:.6g} rad where the arm is told to be; at most {self._max_jump:g} rad at once "
                    "(parameter max_jump_rad); the arm holds"
                )
        return ""

    def _brake(self, index: int, change: float, period_s: float) -> None:
        velocity = self._velocities[index]
        velocity -= min(max(velocity, -change), change)
        self._velocities[index] = velocity
        self.sent[index] += velocity * period_s
        self._targets[index] = self.sent[index]

    def _approach(self, index: int, command: float, joint: CheckedJoint, period_s: float) -> None:
        """Moves to the command at once if the limits of velocity and acceleration allow it, else as fast as they do.

        "At once" also requires that the joint can have the velocity of the commands in the next cycle, so that it does
        not overshoot.
        """
        position, velocity = self.sent[index], self._velocities[index]
        slowest, fastest = joint.velocity_range(position, period_s)
        deceleration = joint.limits.max_acceleration
        change = deceleration * period_s
        pace = (command - self._targets[index]) / period_s
        self._targets[index] = command
        wanted = (command - position) / period_s
        at_once = max(abs(wanted - velocity), abs(wanted - pace)) <= change * (1.0 + _SLACK)
        if at_once and slowest * (1.0 + _SLACK) <= wanted <= fastest * (1.0 + _SLACK):
            self._velocities[index] = wanted
            self.sent[index] = command
            return
        pace = min(max(pace, slowest), fastest)
        behind = command - pace * period_s - position
        goal = pace + math.copysign(_closing_speed(abs(behind), deceleration, period_s), behind)
        velocity += min(max(min(max(goal, slowest), fastest) - velocity, -change), change)
        self._velocities[index] = velocity
        self.sent[index] = position + velocity * period_s


def _braking_distance(velocity: float, joint: CheckedJoint) -> float:
    return velocity**2 / (2.0 * SHARP_BRAKING_FRACTION * joint.limits.max_acceleration)


def _closing_speed(distance: float, deceleration: float, period_s: float) -> float:
    """Returns the highest speed from which a joint can stop within `distance` [rad], braking once per period.

    A cycle at that speed leaves a distance whose closing speed is lower by what is braked in a cycle, or nothing.
    """
    step = deceleration * period_s
    cycles = distance / (step * period_s)  # that it takes at the speed of one step
    brakings = math.floor(math.sqrt(0.25 + 2.0 * cycles) - 0.5)
    return step * (cycles / (brakings + 1) + 0.5 * brakings)
