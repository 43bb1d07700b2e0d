# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits from the robot description and from the parameters `joint_limits/<joint>/...`.

The parameters have the names of ros_control: `has_position_limits`, `min_position`, `max_position`, `angle_wraparound`,
`has_velocity_limits`, `max_velocity`, `has_acceleration_limits`, `max_acceleration`, `has_effort_limits`, `max_effort`,
and for soft limits `has_soft_limits`, `soft_lower_limit`, `soft_upper_limit`, `k_position`, `k_velocity`. As in
ros_control, a value without `has_...: true` and an incomplete group are ignored, with a warning.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

from modular_framework_control.hardware_interface.urdf_xml import parse_description
from modular_framework_ros.node_handle import NodeHandle, ParameterError, read_bool, read_number
from modular_framework_urdf.robot import Joint, SafetyController

LOGGER = logging.getLogger("rosout.joint_limits")
INFINITY = math.inf
GOAL_TOLERANCE = 1e-3
"""Tolerance for goals beyond a position limit [rad|m]; covers rounded angles."""
MEASUREMENT_FRACTION, MEASUREMENT_TOLERANCE = 0.01, 0.01
"""Tolerance for measured positions beyond a limit: fraction of the range, and [rad|m]; the smaller value applies."""
SOFT_LIMIT_KEYS = ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of one joint; infinite if unlimited.

    Attributes:
        min_position: Minimum position [rad|m].
        max_position: Maximum position [rad|m].
        max_velocity: Maximum absolute velocity [rad/s|m/s].
        max_effort: Maximum absolute effort [Nm|N].
        continuous: Whether the joint is continuous, so that positions 2 pi apart are equal.
        max_acceleration: Maximum absolute acceleration [rad/s^2|m/s^2].
    """

    min_position: float = -INFINITY
    max_position: float = INFINITY
    max_velocity: float = INFINITY
    max_effort: float = INFINITY
    continuous: bool = False
    max_acceleration: float = INFINITY

    def range_from(self, position: float) -> tuple[float, float]:
        """Returns the minimum and maximum position [rad|m], widened to include the joint's current `position`."""
        return min(self.min_position, position), max(self.max_position, position)

    def is_beyond(self, position: float) -> bool:
        """Returns whether a measured `position` [rad|m] is outside the range by more than the measurement tolerance."""
        tolerance = min(MEASUREMENT_TOLERANCE, MEASUREMENT_FRACTION * (self.max_position - self.min_position))
        return position < self.min_position - tolerance or position > self.max_position + tolerance


@dataclass(frozen=True, slots=True)
class SoftJointLimits:
    """Soft position limits, which a joint approaches at decreasing speed.

    Attributes:
        min_position: Minimum position [rad|m].
        max_position: Maximum position [rad|m].
        k_position: Velocity limit per distance to the soft limit [1/s].
        k_velocity: Effort limit per difference between the velocity and its limit [Nm s/rad|N s/m].
    """

    min_position: float
    max_position: float
    k_position: float
    k_velocity: float


def limits_from_urdf(robot_description: str) -> dict[str, JointLimits]:
    """Returns the limits of all movable joints in a URDF.

    Raises:
        ParameterError: The text is not XML, or a limit is not a number.
    """
    return {joint.name: _limits_of(joint) for joint in parse_description(robot_description).movable_joints()}


def soft_limits_from_urdf(robot_description: str) -> dict[str, SoftJointLimits]:
    """Returns the soft limits of all movable joints with a <safety_controller> in a URDF.

    Raises:
        ParameterError: The text is not XML, or a value is not a number.
    """
    return {
        joint.name: _soft_limits_of(joint.safety, joint.kind == "continuous")
        for joint in parse_description(robot_description).movable_joints()
        if joint.safety is not None
    }


def _soft_limits_of(safety: SafetyController, continuous: bool) -> SoftJointLimits:
    lower, upper = safety.soft_lower_limit or 0.0, safety.soft_upper_limit or 0.0
    if continuous or lower >= upper:
        lower, upper = -INFINITY, INFINITY
    return SoftJointLimits(lower, upper, safety.k_position or 0.0, safety.k_velocity or 0.0)


def _limits_of(joint: Joint) -> JointLimits:
    continuous = joint.kind == "continuous"
    limit = joint.limit
    if limit is None:
        return JointLimits(continuous=continuous)
    return JointLimits(
        min_position=-INFINITY if continuous else limit.lower,
        max_position=INFINITY if continuous else limit.upper,
        max_velocity=INFINITY if limit.velocity is None else abs(limit.velocity),
        max_effort=INFINITY if limit.effort is None else abs(limit.effort),
        continuous=continuous,
    )


def limits_with_parameters(name: str, limits: JointLimits, root_nh: NodeHandle) -> JointLimits:
    """Returns the limits overridden by `joint_limits/<name>/`; `has_..._limits: false` removes a limit.

    Args:
        name: Name of the joint.
        limits: Limits from the robot description.
        root_nh: Namespace of `joint_limits`.

    Raises:
        ParameterError: A value has the wrong type, or the range is empty.
    """
    handle = root_nh.child(f"joint_limits/{name}")
    bounds = _read_group(handle, "has_position_limits", ("min_position", "max_position"))
    if bounds is not None:
        limits = replace(limits, min_position=bounds[0], max_position=bounds[1])
    elif _flag(handle, "has_position_limits") is False:
        continuous = read_bool(handle, "angle_wraparound", limits.continuous)
        limits = replace(limits, min_position=-INFINITY, max_position=INFINITY, continuous=continuous)
    if limits.min_position > limits.max_position:
        raise ParameterError(
            f"parameters {handle.namespace}: the range of the joint is from {limits.min_position} to "
            f"{limits.max_position}; min_position must not exceed max_position"
        )
    return replace(
        limits,
        max_velocity=_read_max(handle, "velocity", limits.max_velocity),
        max_acceleration=_read_max(handle, "acceleration", limits.max_acceleration),
        max_effort=_read_max(handle, "effort", limits.max_effort),
    )


def _flag(handle: NodeHandle, key: str) -> bool | None:
    return read_bool(handle, key, False) if handle.has_param(key) else None


def _read_group(
    handle: NodeHandle, flag: str, keys: tuple[str, ...], minimum: float | None = None
) -> list[float] | None:
    """Returns the values of `keys` if `flag` is true and all are set; else None, with a warning for ignored keys."""
    present = [key for key in keys if handle.has_param(key)]
    if _flag(handle, flag):
        if len(present) == len(keys):
            return [read_number(handle, key, 0.0, minimum) for key in keys]
        LOGGER.warning(
            "parameters %s: %s is true, but the group %s is incomplete (set: %s) and ignored; set all of them",
            handle.namespace,
            flag,
            ", ".join(keys),
            ", ".join(present) or "none",
        )
    elif present and not handle.has_param(flag):
        LOGGER.warning(
            "parameters %s: ignoring %s, because %s is not set; set it to true",
            handle.namespace,
            ", ".join(present),
            flag,
        )
    return None


def _read_max(handle: NodeHandle, quantity: str, default: float) -> float:
    values = _read_group(handle, f"has_{quantity}_limits", (f"max_{quantity}",), 0.0)
    if values is not None:
        return values[0]
    return INFINITY if _flag(handle, f"has_{quantity}_limits") is False else default


def soft_limits_with_parameters(
    name: str, limits: SoftJointLimits | None, root_nh: NodeHandle
) -> SoftJointLimits | None:
    """Returns the soft limits in `joint_limits/<name>/`, else `limits`.

    Args:
        name: Name of the joint.
        limits: Soft limits from the robot description, or None.
        root_nh: Namespace of `joint_limits`.

    Raises:
        ParameterError: A value is not a number or negative, or the range is empty.
    """
    handle = root_nh.child(f"joint_limits/{name}")
    values = _read_group(handle, "has_soft_limits", SOFT_LIMIT_KEYS)
    if values is None:
        return limits
    lower, upper, k_position, k_velocity = values
    if lower >= upper:
        raise ParameterError(
            f"parameters {handle.namespace}: soft limits from {lower} to {upper}; soft_lower_limit "
            "must be below soft_upper_limit"
        )
    if min(k_position, k_velocity) < 0.0:
        raise ParameterError(
            f"parameters {handle.namespace}: k_position is {k_position} and k_velocity is {k_velocity}; "
            "neither may be negative"
        )
    return SoftJointLimits(lower, upper, k_position, k_velocity)
