# SPDX-License-Identifier: BSD-3-Clause
"""Checks every position command before it is sent to the arm.

A command that is not finite, outside the position limits of a joint or far from the last command is refused, and the
arm brakes. A command that exceeds only the velocity or acceleration limit is followed as fast as the limits allow. A
command beyond a soft limit, or beyond a position limit by the tolerance of the trajectory controllers, is followed up
to the limit. A joint outside its position limits may stay there or return.

The limits have the types of modular_framework_control.hardware_interface.joint_limits. That module replaces an invalid
command by the nearest valid command. A real arm must not move to its position limit because of a faulty controller, and
its controller triggers a protective stop after a velocity step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_control.hardware_interface.joint_limit_parameters import JointLimits, SoftJointLimits
from modular_framework_control.hardware_interface.joint_limits import soft_velocities
from modular_framework_control.trajectory.motion_limits import CURVE_MARGIN
from modular_framework_control.trajectory.stop_motion import FOLLOWING_LAG_S, SHARP_BRAKING_FRACTION

_RELATIVE_TOLERANCE = 1e-6  # rounding tolerance, relative to a limit


@dataclass(frozen=True, slots=True)
class CheckedJoint:
    """Holds the limits of a joint.

    Attributes:
        name: Name of the joint.
        limits: Limits of position [rad], velocity [rad/s] and acceleration [rad/s^2]; all finite.
        soft: Soft limits; None if absent.
    """

    name: str
    limits: JointLimits
    soft: SoftJointLimits | None = None

    def velocity_range(self, position: float, period_s: float) -> tuple[float, float]:
        """Returns the minimum and maximum velocity [rad/s] from which the joint can stop within its limits.

        Args:
            position: Joint position [rad].
            period_s: Period of the loop [s].
        """
        limits = self.limits
        min_velocity, max_velocity = -limits.max_velocity, limits.max_velocity
        if self.soft is not None:
            min_velocity, max_velocity = soft_velocities(position, limits, self.soft)
        distance_below, distance_above = (
            max(position - limits.min_position, 0.0),
            max(limits.max_position - position, 0.0),
        )
        return (
            max(min_velocity, -_closing_speed(distance_below, limits.max_acceleration, period_s)),
            min(max_velocity, _closing_speed(distance_above, limits.max_acceleration, period_s)),
        )


class CommandCheck:
    """Checks position commands and computes the positions to send to the arm.

    Args:
        joints: Joints in the order of the commands.
        max_jump: Maximum distance between a command and the last sent position [rad].

    Attributes:
        sent: Positions to send [rad]; set by `admit` and `reset`.
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
        """Returns the position at which a joint comes to rest if it brakes now [rad].

        Args:
            index: Index of the joint.
            position: Current position [rad].
            velocity: Current velocity [rad/s].
        """
        joint = self._joints[index]
        min_position, max_position = joint.limits.range_from(position)
        stopping_displacement = velocity * FOLLOWING_LAG_S + math.copysign(_braking_distance(velocity, joint), velocity)
        return min(max(position + stopping_displacement, min_position), max_position)

    def admit(self, commands: Sequence[float], period_s: float) -> str:
        """Checks the commands and sets `sent` to the positions for the arm.

        Args:
            commands: Commanded positions [rad].
            period_s: Time since the last call [s].

        Returns:
            The reason if the commands are refused, in which case `sent` brings the arm to rest; otherwise "".
        """
        reason = self._refusal_reason(commands)
        if period_s <= 0.0:
            return reason
        for index, joint in enumerate(self._joints):
            limits = joint.limits
            if reason:
                self._decelerate(index, limits.max_acceleration * period_s, period_s)
            else:
                min_position, max_position = limits.range_from(self.sent[index])
                self._approach(index, min(max(commands[index], min_position), max_position), joint, period_s)
        return reason

    def _refusal_reason(self, commands: Sequence[float]) -> str:
        for command, sent, velocity, joint in zip(commands, self.sent, self._velocities, self._joints, strict=True):
            limits = joint.limits
            if not math.isfinite(command):
                return f"joint '{joint.name}': command {command} is not finite; the arm holds"
            min_position, max_position = limits.range_from(sent)
            if not min_position - CURVE_MARGIN <= command <= max_position + CURVE_MARGIN:
                return (
                    f"joint '{joint.name}': command {command:.6g} rad is outside its range "
                    f"[{limits.min_position:.6g}, {limits.max_position:.6g}] rad; the arm holds"
                )
            if abs(command - sent) > self._max_jump + _braking_distance(velocity, joint):
                return (
                    f"joint '{joint.name}': command {command:.6g} rad is {abs(command - sent):.3g} rad away from "
                    f"the last sent position {sent:.6g} rad; at most {self._max_jump:g} rad is allowed "
                    "(parameter max_jump_rad); the arm holds"
                )
        return ""

    def _decelerate(self, index: int, max_velocity_change: float, period_s: float) -> None:
        velocity = self._velocities[index]
        velocity -= min(max(velocity, -max_velocity_change), max_velocity_change)
        self._velocities[index] = velocity
        self.sent[index] += velocity * period_s
        self._targets[index] = self.sent[index]

    def _approach(self, index: int, command: float, joint: CheckedJoint, period_s: float) -> None:
        """Moves to the command within one cycle, or as fast as the velocity and acceleration limits allow.

        After a motion within one cycle, the joint must be able to follow the velocity of the commands in the next cycle
        without overshooting.
        """
        position, velocity = self.sent[index], self._velocities[index]
        min_velocity, max_velocity = joint.velocity_range(position, period_s)
        deceleration = joint.limits.max_acceleration
        max_velocity_change = deceleration * period_s
        command_velocity = (command - self._targets[index]) / period_s
        self._targets[index] = command
        required_velocity = (command - position) / period_s
        within_one_cycle = max(
            abs(required_velocity - velocity), abs(required_velocity - command_velocity)
        ) <= max_velocity_change * (1.0 + _RELATIVE_TOLERANCE)
        if within_one_cycle and min_velocity * (1.0 + _RELATIVE_TOLERANCE) <= required_velocity <= max_velocity * (
            1.0 + _RELATIVE_TOLERANCE
        ):
            self._velocities[index] = required_velocity
            self.sent[index] = command
            return
        command_velocity = min(max(command_velocity, min_velocity), max_velocity)
        position_error = command - command_velocity * period_s - position
        target_velocity = command_velocity + math.copysign(
            _closing_speed(abs(position_error), deceleration, period_s), position_error
        )
        velocity += min(
            max(min(max(target_velocity, min_velocity), max_velocity) - velocity, -max_velocity_change),
            max_velocity_change,
        )
        self._velocities[index] = velocity
        self.sent[index] = position + velocity * period_s


def _braking_distance(velocity: float, joint: CheckedJoint) -> float:
    return velocity**2 / (2.0 * SHARP_BRAKING_FRACTION * joint.limits.max_acceleration)


def _closing_speed(distance: float, deceleration: float, period_s: float) -> float:
    """Returns the maximum speed from which a joint that brakes once per period can stop within `distance` [rad].

    After a cycle at this speed, the maximum speed for the remaining distance is one braking step lower, or 0.
    """
    velocity_step = deceleration * period_s
    cycles = distance / (velocity_step * period_s)  # number of cycles for the distance at the speed of one braking step
    braking_cycles = math.floor(math.sqrt(0.25 + 2.0 * cycles) - 0.5)
    return velocity_step * (cycles / (braking_cycles + 1) + 0.5 * braking_cycles)
