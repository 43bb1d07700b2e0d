# SPDX-License-Identifier: BSD-3-Clause
"""Keeps joint commands within the limits of the robot, whatever a controller asks for.

Limits come from the robot description and may be replaced, value by value, by parameters `joint_limits/<joint>/...`
under the names MoveIt and ros_control use.
"""
from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass, replace

from modular_framework_control.hardware_interface import JointHandle
from modular_framework_control.node_handle import NodeHandle, ParameterError, read_bool, read_number

INFINITY = math.inf


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of one joint; infinite where there is none.

    Attributes:
        min_position: [rad] or [m].
        max_position: [rad] or [m].
        max_velocity: largest absolute velocity [rad/s] or [m/s].
        max_effort: largest absolute effort [Nm] or [N].
        continuous: whether the joint turns without end, so that positions 2 pi apart are the same place.
    """

    min_position: float = -INFINITY
    max_position: float = INFINITY
    max_velocity: float = INFINITY
    max_effort: float = INFINITY
    continuous: bool = False


def limits_from_urdf(robot_description: str) -> dict[str, JointLimits]:
    """Limits of every movable joint of a URDF text.

    Raises:
        ParameterError: the text is not XML, or a limit is not a number.
    """
    try:
        root = ElementTree.fromstring(robot_description)
    except ElementTree.ParseError as error:
        raise ParameterError(f"robot_description: not well-formed XML ({error})") from error
    limits: dict[str, JointLimits] = {}
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic", "continuous"):
            limits[joint.get("name", "")] = _limits_of(joint)
    return limits


def _limits_of(joint: ElementTree.Element) -> JointLimits:
    continuous = joint.get("type") == "continuous"
    limit = joint.find("limit")
    if limit is None:
        return JointLimits(continuous=continuous)
    try:
        values = {key: float(limit.get(key, default)) for key, default in
                  (("lower", "0"), ("upper", "0"), ("velocity", "inf"), ("effort", "inf"))}
    except ValueError as error:
        raise ParameterError(f"robot_description: <limit> of joint '{joint.get('name')}': {error}") from error
    return JointLimits(
        min_position=-INFINITY if continuous else values["lower"],
        max_position=INFINITY if continuous else values["upper"],
        max_velocity=values["velocity"],
        max_effort=values["effort"],
        continuous=continuous,
    )


def limits_with_parameters(name: str, limits: JointLimits, root_nh: NodeHandle) -> JointLimits:
    """`limits` with what `joint_limits/<name>/` says put in its place.

    Raises:
        ParameterError: a value of the wrong type.
    """
    handle = root_nh.child(f"joint_limits/{name}")
    if read_bool(handle, "has_position_limits", False):
        limits = replace(limits, min_position=read_number(handle, "min_position", limits.min_position, None),
                         max_position=read_number(handle, "max_position", limits.max_position, None))
    if read_bool(handle, "has_velocity_limits", False):
        limits = replace(limits, max_velocity=read_number(handle, "max_velocity", limits.max_velocity))
    if read_bool(handle, "has_effort_limits", False):
        limits = replace(limits, max_effort=read_number(handle, "max_effort", limits.max_effort))
    return limits


class PositionJointSaturation:
    """Saturates position commands: inside the range, and no faster than the velocity limit from one cycle to the next.

    Args:
        handle: the joint.
        limits: its limits.
    """

    __slots__ = ("handle", "limits", "_last_command")

    def __init__(self, handle: JointHandle, limits: JointLimits) -> None:
        self.handle = handle
        self.limits = limits
        self._last_command = math.nan

    def reset(self) -> None:
        """Forget the last command, after the joint was moved by other means."""
        self._last_command = math.nan

    def enforce_limits(self, period_s: float) -> None:
        """Replace `handle.command` by the nearest allowed one; a command that is not a number keeps the last one.

        Args:
            period_s: time since the last call [s].
        """
        limits, handle = self.limits, self.handle
        last = handle.position if math.isnan(self._last_command) else self._last_command
        command = last if math.isnan(handle.command) else handle.command
        reach = limits.max_velocity * period_s if period_s > 0.0 else 0.0
        if command > last + reach:
            command = last + reach
        elif command < last - reach:
            command = last - reach
        if command > limits.max_position:
            command = limits.max_position
        elif command < limits.min_position:
            command = limits.min_position
        self._last_command = command
        handle.command = command


class SymmetricSaturation:
    """Saturates a velocity or effort command to a largest absolute value; not a number becomes 0.

    Args:
        handle: the joint.
        bound: largest absolute command, in the unit of the command.
    """

    __slots__ = ("handle", "bound")

    def __init__(self, handle: JointHandle, bound: float) -> None:
        self.handle = handle
        self.bound = bound

    def enforce_limits(self, period_s: float) -> None:
        """Replace `handle.command` by the nearest allowed one."""
        del period_s
        command = 0.0 if math.isnan(self.handle.command) else self.handle.command
        self.handle.command = max(-self.bound, min(self.bound, command))


def enforce_all(saturations: Iterable[PositionJointSaturation | SymmetricSaturation], period_s: float) -> None:
    """Saturate every command; called by a RobotHW at the start of `write`."""
    for saturation in saturations:
        saturation.enforce_limits(period_s)
