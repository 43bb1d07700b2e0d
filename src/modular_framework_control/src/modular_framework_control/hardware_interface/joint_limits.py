# SPDX-License-Identifier: BSD-3-Clause
"""Enforcement of joint limits on the commands of controllers.

Hardware enforces limits at the start of `write`, with one limiter per command handle (`limit_handle`) or for all
handles at once (`JointLimitGuard`). The rules for positions, velocities and efforts, with and without soft limits, are
those of ros_control's joint_limits_interface.
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
    """Protocol of limiters for the command of one handle."""

    handle: Any

    def reset(self) -> None:
        """Clears the last command, after the joint was moved by other means."""

    def enforce_limits(self, period_s: float) -> None:
        """Replaces the command by the nearest allowed command; `period_s` is the time since the last call."""


class PositionJointSaturation:
    """Saturates position commands to the position range and to the velocity limit.

    With soft limits, the speed towards an end of the soft range is also at most `k_position` times the distance. The
    change is limited relative to the last command instead of the measured position, which lags behind. Only the command
    of `JointHandle.hold` passes unlimited, because it is the measured position. A joint outside its range stays there
    until a command moves it back within the velocity limit.

    Args:
        handle: Joint.
        limits: Limits of the joint.
        soft: Soft limits of the joint, or None.
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
        """Replaces `handle.command` by the nearest allowed command; for NaN, the last command stays.

        Args:
            period_s: Time since the last call.
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
            lower = upper = last
        elif self.soft is None:
            max_step = limits.max_velocity * period_s
            lower, upper = last - max_step, last + max_step
        else:
            min_velocity, max_velocity = soft_velocities(last, limits, self.soft)
            lower, upper = last + min_velocity * period_s, last + max_velocity * period_s
        min_position, max_position = limits.range_from(last)
        if command > max_position:
            command = max_position
        elif command < min_position:
            command = min_position
        if command > upper:
            command = upper
        elif command < lower:
            command = lower
        self._last_command = command
        handle.command = command


class PosVelJointSaturation(PositionJointSaturation):
    """Saturates positions as above, and the commanded velocities (and accelerations) to their maxima."""

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        super().enforce_limits(period_s)
        handle: Any = self.handle
        handle.command_velocity = _clamped_value(handle.command_velocity, self.limits.max_velocity)
        if hasattr(handle, "command_acceleration"):
            handle.command_acceleration = _clamped_value(handle.command_acceleration, self.limits.max_acceleration)


class _Saturation:
    """Base class for velocity and effort limits of one joint, which stores the requested and the limited command.

    A stopping controller commands 0 only once. The limited command that replaces this 0 must not become the request of
    the next cycle, so the 0 stays active until a controller sets a new command. For positions, in contrast, the joint
    stays at the limited command.

    Args:
        handle: Joint.
        limits: Limits of the joint.
        soft: Soft limits of the joint, or None.
    """

    __slots__ = ("handle", "limits", "soft", "_command", "_limited")

    def __init__(self, handle: JointHandle, limits: JointLimits, soft: SoftJointLimits | None = None) -> None:
        self.handle = handle
        self.limits = limits
        self.soft = soft
        self._command = 0.0
        self._limited: float | None = None

    def reset(self) -> None:
        """Clears the limited command, after the joint was moved by other means; the controller's command stays."""
        self.handle.command = self._controller_command()
        self._limited = None

    def _controller_command(self) -> float:
        """Returns the last command of a controller, with NaN replaced by 0."""
        command = self.handle.command
        if command is not self._limited:
            self._command = command if command == command else 0.0
        return self._command

    def _set_limited(self, command: float) -> None:
        self._limited = self.handle.command = (
            command + 0.0
        )  # a new object, so that `is` detects commands of controllers


class VelocityJointSaturation(_Saturation):
    """Saturates velocity commands.

    The limits are the maximum velocity and the maximum change from the last command, initially from the measured
    velocity. At an end of the range, only velocities back into the range are allowed, regardless of the change. With
    soft limits, the velocity towards an end of the soft range is at most `k_position` times the distance to this end.
    NaN becomes 0.
    """

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        """Replaces `handle.command` by the nearest allowed command."""
        limits, state = self.limits, self.handle.state
        command, position = self._controller_command(), state.position
        if self.soft is None:
            lower, upper = -limits.max_velocity, limits.max_velocity
        else:
            lower, upper = soft_velocities(position, limits, self.soft)
        if limits.max_acceleration < math.inf:
            change = limits.max_acceleration * max(0.0, period_s)
            last = state.velocity if self._limited is None else self._limited
            lower, upper = max(lower, last - change), min(upper, last + change)
        command = max(lower, min(upper, command))
        if position >= limits.max_position:
            command = min(command, 0.0)
        if position <= limits.min_position:
            command = max(command, 0.0)
        self._set_limited(command)


class EffortJointSaturation(_Saturation):
    """Saturates effort commands.

    The limits are the maximum effort, and 0 towards the outside for a joint outside its range or beyond its maximum
    velocity. With soft limits, the effort is at most `k_velocity` times the difference between the velocity limit at
    the current position and the measured velocity. NaN becomes 0.
    """

    __slots__ = ()

    def enforce_limits(self, period_s: float) -> None:
        """Replaces `handle.command` by the nearest allowed command."""
        del period_s
        limits, state = self.limits, self.handle.state
        position, velocity = state.position, state.velocity
        lower, upper = -limits.max_effort, limits.max_effort
        if self.soft is not None:
            min_velocity, max_velocity = soft_velocities(position, limits, self.soft)
            if min_velocity > -math.inf:
                lower = _clamped_value(self.soft.k_velocity * (min_velocity - velocity), limits.max_effort)
            if max_velocity < math.inf:
                upper = _clamped_value(self.soft.k_velocity * (max_velocity - velocity), limits.max_effort)
        if position < limits.min_position or velocity < -limits.max_velocity:
            lower = max(lower, 0.0)
        if position > limits.max_position or velocity > limits.max_velocity:
            upper = min(upper, 0.0)
        self._set_limited(max(lower, min(upper, self._controller_command())))


def _clamped_value(value: float, bound: float) -> float:
    """Returns `value` clamped to +-`bound`, with NaN replaced by 0."""
    return max(-bound, min(bound, value)) if value == value else 0.0


def soft_velocities(position: float, limits: JointLimits, soft: SoftJointLimits) -> tuple[float, float]:
    """Returns the minimum and maximum velocity allowed at `position`; both are 0 for NaN.

    Rest is always allowed, so that a soft limit never moves a joint.

    Args:
        position: Position of the joint [rad|m].
        limits: Limits of the joint.
        soft: Soft limits of the joint.
    """
    if position != position:
        return 0.0, 0.0
    bound = limits.max_velocity
    lower = -bound if soft.min_position == -math.inf else soft.k_position * (soft.min_position - position)
    upper = bound if soft.max_position == math.inf else soft.k_position * (soft.max_position - position)
    return max(-bound, min(0.0, lower)), min(bound, max(0.0, upper))


def limit_handle(
    interface_class: type[HardwareInterface[Any]],
    handle: JointHandle,
    limits: JointLimits,
    soft_limits: SoftJointLimits | None = None,
) -> JointLimiter:
    """Returns the limiter for the commanded quantity of a handle, and sets `handle.limits`.

    Args:
        interface_class: Interface of the handle.
        handle: Joint.
        limits: Limits of the joint.
        soft_limits: Soft limits of the joint, or None.
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
    """Returns the known limits of joints: enforced limits, else the limits in `robot_description` and `joint_limits`.

    Args:
        handles: Joints.
        root_nh: Namespace of `robot_description` and `joint_limits/<joint>/...`, which are optional.

    Raises:
        ParameterError: A limit is invalid; the message names the parameter.
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
    """Returns a description of command handles without limits, or ""."""
    missing = []
    for interface, handle in robot_hw.command_handles:
        limits = handle.limits if handle.limits is not None else JointLimits()
        if isinstance(interface, EffortJointInterface):
            kinds = ["effort"] if limits.max_effort == math.inf else []
        else:
            kinds = ["velocity"] if limits.max_velocity == math.inf else []
            if not limits.continuous and math.inf in (-limits.min_position, limits.max_position):
                kinds.append("position")
        if kinds:
            missing.append(f"{' and '.join(kinds)} of joint '{handle.name}' ({interface.type_name})")
    return ", ".join(missing)


def outside_limits(robot_hw: RobotHW) -> dict[str, str]:
    """Returns descriptions of joints outside their ranges, by joint name."""
    return {
        handle.name: f"joint '{handle.name}' is held at {handle.position:.6g}, outside its range "
        f"{handle.limits.min_position:.6g} to {handle.limits.max_position:.6g}, until a goal brings it back"
        for _, handle in robot_hw.command_handles
        if handle.limits is not None and handle.limits.is_beyond(handle.position)
    }


class JointLimitGuard:
    """Enforces the limits of `robot_description` and `joint_limits/<joint>/...` on all commands of a hardware.

    Args:
        robot_hw: Hardware with registered command interfaces.
        root_nh: Namespace of `robot_description` and `joint_limits`, which are optional.

    Attributes:
        limits: Limits of all joints with commands, by joint name.

    Raises:
        ParameterError: A limit is invalid; the message names the parameter.
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
        """Replaces every command by the nearest allowed command; `period_s` is the time since the last call."""
        for limiter in self._limiters:
            limiter.enforce_limits(period_s)

    def reset(self, joints: Iterable[str] | None = None) -> None:
        """Clears the last commands of all or of the given joints, after they were moved by other means."""
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
