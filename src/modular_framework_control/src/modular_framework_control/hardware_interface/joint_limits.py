# SPDX-License-Identifier: BSD-3-Clause
"""Keeps joint commands within the limits of the robot, whatever a controller commands.

A hardware does so first thing in `write`: with one object per command handle (`limit_handle`), or for all its handles
at once (`JointLimitGuard`). The rules for positions, velocities and efforts, with and without soft limits, are those of
ros_control's joint_limits_interface.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    HardwareInterface,
    PosVelAccJointInterface,
    PosVelJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limit_parameters import (
    JointLimits,
    SoftJointLimits,
    limits_from_urdf,
    limits_with_parameters,
    soft_limits_from_urdf,
    soft_limits_with_parameters,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle


class JointLimiter(Protocol):
    """Protocol of the objects that keep the command of one handle within limits."""

    handle: Any

    def reset(self) -> None:
        """Clears the last command, after the joint was moved by other means."""

    def enforce_limits(self, period_s: float) -> None:
        """Replaces the command by the nearest allowed one; `period_s` [s] is the time since the last call."""


class PositionJointSaturation:
    """Saturates position commands: inside the range, and no faster than the velocity limit from one cycle to the next.

    With soft limits the speed towards an end of the soft range is also at most `k_position` times the distance to it.
    It limits the change from the last command, not from the measured position, which lags behind. Only the command of
    `JointHandle.hold` is passed on at once, because it is the measured position. A joint outside its range stays where
    it is, and a command brings it back, no faster than the velocity limit.

    Args:
        handle: the joint.
        limits: its limits.
        soft: its soft limits, if any.
    """

    __slots__ = ("handle", "limits", "soft", "_last_command")

    def __init__(self, handle: JointHandle, limits: JointLimits, soft: SoftJointLimits | None = None) -> None:
        self.handle = handle
        self.limits = limits
        self.soft = soft
        self._last_command = math.nan

    def reset(self) -> None:
        """Clears the last command, after the joint was moved by other means."""
        self._last_command = math.nan

    def enforce_limits(self, period_s: float) -> None:
        """Replaces `handle.command` by the nearest allowed one; a command that is not a number keeps the last one.

        Args:
            period_s: time since the last call [s].
        """
        limits, handle, last = self.limits, self.handle, self._last_command
        command = handle.command
        if handle.held:
            handle.held = False
            if command == command:
                last = command
        if last != last:
            last = handle.position
        if command != command:
            command = last
        if period_s <= 0.0:
            lowest = highest = last
        elif self.soft is None:
            reach = limits.max_velocity * period_s
            lowest, highest = last - reach, last + reach
        else:
            slowest, fastest = soft_velocities(last, limits, self.soft)
            lowest, highest = last + slowest * period_s, last + fastest * period_s
        smallest, largest = limits.range_from(last)
        if command > largest:
            command = largest
        elif command < smallest:
            command = smallest
        if command > highest:
            command = highest
        elif command < lowest:
            command = lowest
        self._last_command = command
        handle.command = command


class PosVelJointSaturation(PositionJointSaturation):
    """Saturates positions as above, and the velocities (and accelerations) commanded with them to their largest."""

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        super().enforce_limits(period_s)
        handle: Any = self.handle
        handle.command_velocity = _clamped(handle.command_velocity, self.limits.max_velocity)
        if hasattr(handle, "command_acceleration"):
            handle.command_acceleration = _clamped(handle.command_acceleration, self.limits.max_acceleration)


class _Saturation:
    """Bounds the velocities or efforts of one joint; stores the controller's command and the one it became.

    A controller that stops commands 0 once. The limited command that replaced it must not become the command of the
    next cycle, so the 0 stays in force until a controller commands something else. That differs from a position, where
    the limited command is where the joint is to stay.

    Args:
        handle: the joint.
        limits: its limits.
        soft: its soft limits, if any.
    """

    __slots__ = ("handle", "limits", "soft", "_command", "_limited")

    def __init__(self, handle: JointHandle, limits: JointLimits, soft: SoftJointLimits | None = None) -> None:
        self.handle = handle
        self.limits = limits
        self.soft = soft
        self._command = 0.0
        self._limited: float | None = None

    def reset(self) -> None:
        """Clears the limited command, after the joint was moved by other means; the command of the controller stays."""
        self.handle.command = self._commanded()
        self._limited = None

    def _commanded(self) -> float:
        """Returns the last command of a controller; 0 if that is not a number."""
        command = self.handle.command
        if command is not self._limited:
            self._command = command if command == command else 0.0
        return self._command

    def _set_limited(self, command: float) -> None:
        self._limited = self.handle.command = command + 0.0  # a new object: `is` finds commands of others


class VelocityJointSaturation(_Saturation):
    """Saturates velocity commands.

    Largest velocity, largest change from one command to the next, the first one from the measured velocity; at an end
    of the range only velocities back into it, whatever change that takes. With soft limits at most `k_position` times
    the distance to their end. Not a number becomes 0.
    """

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        """Replaces `handle.command` by the nearest allowed one."""
        limits, state = self.limits, self.handle.state
        command, position = self._commanded(), state.position
        if self.soft is None:
            lowest, highest = -limits.max_velocity, limits.max_velocity
        else:
            lowest, highest = soft_velocities(position, limits, self.soft)
        if limits.max_acceleration < math.inf:
            change = limits.max_acceleration * max(0.0, period_s)
            last = state.velocity if self._limited is None else self._limited
            lowest, highest = max(lowest, last - change), min(highest, last + change)
        command = max(lowest, min(highest, command))
        if position >= limits.max_position:
            command = min(command, 0.0)
        if position <= limits.min_position:
            command = max(command, 0.0)
        self._set_limited(command)


class EffortJointSaturation(_Saturation):
    """Saturates effort commands.

    Largest effort; none that drives a joint further out of its range or beyond its largest velocity. With soft limits
    at most `k_velocity` times what is left to the velocity that is allowed there. Not a number becomes 0.
    """

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        """Replaces `handle.command` by the nearest allowed one."""
        del period_s
        limits, state = self.limits, self.handle.state
        position, velocity = state.position, state.velocity
        lowest, highest = -limits.max_effort, limits.max_effort
        if self.soft is not None:
            slowest, fastest = soft_velocities(position, limits, self.soft)
            if slowest > -math.inf:
                lowest = _clamped(self.soft.k_velocity * (slowest - velocity), limits.max_effort)
            if fastest < math.inf:
                highest = _clamped(self.soft.k_velocity * (fastest - velocity), limits.max_effort)
        if position < limits.min_position or velocity < -limits.max_velocity:
            lowest = max(lowest, 0.0)
        if position > limits.max_position or velocity > limits.max_velocity:
            highest = min(highest, 0.0)
        self._set_limited(max(lowest, min(highest, self._commanded())))


def _clamped(value: float, bound: float) -> float:
    """`value` within `bound` on both sides of 0; 0 when it is not a number."""
    return max(-bound, min(bound, value)) if value == value else 0.0


def soft_velocities(position: float, limits: JointLimits, soft: SoftJointLimits) -> tuple[float, float]:
    """Smallest and largest velocity allowed at `position`: none while that is not a number.

    Rest is always allowed, so that a joint beyond a soft limit is not moved by it.
    """
    if position != position:
        return 0.0, 0.0
    largest = limits.max_velocity
    lowest = -largest if soft.min_position == -math.inf else soft.k_position * (soft.min_position - position)
    highest = largest if soft.max_position == math.inf else soft.k_position * (soft.max_position - position)
    return max(-largest, min(0.0, lowest)), min(largest, max(0.0, highest))


def limit_handle(
    interface_class: type[HardwareInterface[Any]],
    handle: JointHandle,
    limits: JointLimits,
    soft_limits: SoftJointLimits | None = None,
) -> JointLimiter:
    """Returns the limiter for the commanded quantity of a handle, and sets `handle.limits`.

    Args:
        interface_class: interface the handle belongs to.
        handle: the joint.
        limits: its limits.
        soft_limits: its soft limits, if any.
    """
    handle.limits = limits
    if issubclass(interface_class, VelocityJointInterface):
        return VelocityJointSaturation(handle, limits, soft_limits)
    if issubclass(interface_class, EffortJointInterface):
        return EffortJointSaturation(handle, limits, soft_limits)
    if issubclass(interface_class, (PosVelJointInterface, PosVelAccJointInterface)):
        return PosVelJointSaturation(handle, limits, soft_limits)
    return PositionJointSaturation(handle, limits, soft_limits)


def limits_of(handles: Sequence[JointHandle], root_nh: NodeHandle) -> list[JointLimits]:
    """Returns the known limits of joints.

    Those their hardware enforces; where it enforces none, those of `robot_description` and `joint_limits/<joint>/...`.

    Args:
        handles: the joints.
        root_nh: where `robot_description` and `joint_limits` are found, if they are there.

    Raises:
        ParameterError: a limit makes no sense; says which parameter.
    """
    unknown = [handle.name for handle in handles if handle.limits is None]
    description = root_nh.get_param("robot_description") if unknown else None
    described = limits_from_urdf(description) if isinstance(description, str) else {}
    return [
        handle.limits
        if handle.limits is not None
        else limits_with_parameters(handle.name, described.get(handle.name, JointLimits()), root_nh)
        for handle in handles
    ]


def missing_limits(robot_hw: RobotHW) -> str:
    """Names the joints whose hardware does not limit what is commanded, and the limits they lack; "" if none does."""
    missing = []
    for interface, handle in robot_hw.command_handles:
        limits = handle.limits if handle.limits is not None else JointLimits()
        if isinstance(interface, EffortJointInterface):
            lacks = ["effort"] if limits.max_effort == math.inf else []
        else:
            lacks = ["velocity"] if limits.max_velocity == math.inf else []
            if not limits.continuous and math.inf in (-limits.min_position, limits.max_position):
                lacks.append("position")
        if lacks:
            missing.append(f"{' and '.join(lacks)} of joint '{handle.name}' ({interface.type_name})")
    return ", ".join(missing)


def outside_limits(robot_hw: RobotHW) -> dict[str, str]:
    """Returns the joints that are held outside their range, and a description of each."""
    return {
        handle.name: f"joint '{handle.name}' is held at {handle.position:.6g}, outside its range "
        f"{handle.limits.min_position:.6g} to {handle.limits.max_position:.6g}, until a goal brings it back"
        for _, handle in robot_hw.command_handles
        if handle.limits is not None and handle.limits.is_beyond(handle.position)
    }


class JointLimitGuard:
    """Keeps all commands of a hardware within the limits of `robot_description` and of `joint_limits/<joint>/...`.

    Args:
        robot_hw: hardware whose command interfaces are registered.
        root_nh: where `robot_description` and `joint_limits` are found, if they are there.

    Attributes:
        limits: limits by joint name, of every joint that can be commanded.

    Raises:
        ParameterError: a limit makes no sense; says which parameter.
    """

    def __init__(self, robot_hw: RobotHW, root_nh: NodeHandle) -> None:
        description = root_nh.get_param("robot_description")
        known = limits_from_urdf(description) if isinstance(description, str) else {}
        soft = soft_limits_from_urdf(description) if isinstance(description, str) else {}
        self.limits: dict[str, JointLimits] = {}
        self._limiters: list[JointLimiter] = []
        for interface, handle in robot_hw.command_handles:
            name = handle.name
            self.limits[name] = limits_with_parameters(name, known.get(name, JointLimits()), root_nh)
            soft_limits = soft_limits_with_parameters(name, soft.get(name), root_nh)
            self._limiters.append(limit_handle(type(interface), handle, self.limits[name], soft_limits))

    def enforce(self, period_s: float) -> None:
        """Replaces every command by the nearest allowed one; `period_s` [s] is the time since the last call."""
        for limiter in self._limiters:
            limiter.enforce_limits(period_s)

    def reset(self, joints: Iterable[str] | None = None) -> None:
        """Clears the last commands (of these joints), after they were moved by other means."""
        names = self.limits.keys() if joints is None else set(joints)
        for limiter in self._limiters:
            if limiter.handle.name in names:
                limiter.reset()


__all__ = [
    "EffortJointSaturation",
    "JointLimitGuard",
    "JointLimiter",
    "JointLimits",
    "PosVelJointSaturation",
    "PositionJointSaturation",
    "SoftJointLimits",
    "VelocityJointSaturation",
    "limit_handle",
    "limits_from_urdf",
    "limits_of",
    "limits_with_parameters",
    "soft_limits_from_urdf",
    "soft_limits_with_parameters",
    "soft_velocities",
]
