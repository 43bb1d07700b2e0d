# SPDX-License-Identifier: BSD-3-Clause
"""Limits of joints, from the robot description and from parameters `joint_limits/<joint>/...`, checked.

The names are those of ros_control: `has_position_limits`, `min_position`, `max_position`, `angle_wraparound`,
`has_velocity_limits`, `max_velocity`, `has_acceleration_limits`, `max_acceleration`, `has_effort_limits`, `max_effort`,
and for soft limits `has_soft_limits`, `soft_lower_limit`, `soft_upper_limit`, `k_position`, `k_velocity`. As in
ros_control, a value without its `has_...: true` is not in force, and a group that is not complete changes nothing;
since limits are there for safety, the log says so.
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
POINT_MARGIN = 1e-3
"""How far a goal may lie beyond a position limit [rad|m]: rounding of angles."""
MEASURED_FRACTION, MEASURED_MARGIN = 0.01, 0.01
"""A measured position beyond a limit by less than both, of the range and [rad|m], is the accuracy of the hardware."""
SOFT_LIMIT_KEYS = ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of one joint; infinite where there is none.

    Attributes:
        min_position: [rad] or [m].
        max_position: [rad] or [m].
        max_velocity: largest absolute velocity [rad/s] or [m/s].
        max_effort: largest absolute effort [Nm] or [N].
        continuous: whether the joint turns without end, so that positions 2 pi apart are the same.
        max_acceleration: largest absolute acceleration [rad/s^2] or [m/s^2].
    """

    min_position: float = -INFINITY
    max_position: float = INFINITY
    max_velocity: float = INFINITY
    max_effort: float = INFINITY
    continuous: bool = False
    max_acceleration: float = INFINITY

    def range_from(self, position: float) -> tuple[float, float]:
        """Smallest and largest position [rad|m] for a joint at `position`, which may stay outside or come back."""
        return min(self.min_position, position), max(self.max_position, position)

    def is_beyond(self, position: float) -> bool:
        """Whether a measured `position` [rad|m] lies outside the range by more than hardware is accurate."""
        margin = min(MEASURED_MARGIN, MEASURED_FRACTION * (self.max_position - self.min_position))
        return position < self.min_position - margin or position > self.max_position + margin


@dataclass(frozen=True, slots=True)
class SoftJointLimits:
    """A range inside the limits, which a joint approaches the slower the nearer it is.

    Attributes:
        min_position: [rad] or [m].
        max_position: [rad] or [m].
        k_position: velocity allowed per distance to the end of the range [1/s].
        k_velocity: effort allowed per distance to that velocity [Nm s/rad] or [N s/m].
    """

    min_position: float
    max_position: float
    k_position: float
    k_velocity: float


def limits_from_urdf(robot_description: str) -> dict[str, JointLimits]:
    """Limits of every movable joint of a URDF text.

    Raises:
        ParameterError: the text is not XML, or a limit is not a number.
    """
    return {joint.name: _limits_of(joint) for joint in parse_description(robot_description).movable_joints()}


def soft_limits_from_urdf(robot_description: str) -> dict[str, SoftJointLimits]:
    """Soft limits of every movable joint of a URDF text that has a <safety_controller>.

    Raises:
        ParameterError: the text is not XML, or a value is not a number.
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
    """`limits` with what `joint_limits/<name>/` says put in its place; `has_..._limits: false` removes a limit.

    Raises:
        ParameterError: a value of the wrong type, or a range that ends before it begins.
    """
    handle = root_nh.child(f"joint_limits/{name}")
    bounds = _complete(handle, "has_position_limits", ("min_position", "max_position"))
    if bounds is not None:
        limits = replace(limits, min_position=bounds[0], max_position=bounds[1])
    elif _given(handle, "has_position_limits") is False:
        continuous = read_bool(handle, "angle_wraparound", limits.continuous)
        limits = replace(limits, min_position=-INFINITY, max_position=INFINITY, continuous=continuous)
    if limits.min_position > limits.max_position:
        raise ParameterError(
            f"parameters {handle.namespace}: the range of the joint is from {limits.min_position} to "
            f"{limits.max_position}; min_position must not exceed max_position"
        )
    return replace(
        limits,
        max_velocity=_largest(handle, "velocity", limits.max_velocity),
        max_acceleration=_largest(handle, "acceleration", limits.max_acceleration),
        max_effort=_largest(handle, "effort", limits.max_effort),
    )


def _given(handle: NodeHandle, key: str) -> bool | None:
    return read_bool(handle, key, False) if handle.has_param(key) else None


def _complete(handle: NodeHandle, has: str, keys: tuple[str, ...], minimum: float | None = None) -> list[float] | None:
    """The numbers of `keys`, if `has` is true and all of them are set; None, and a warning, when only some are."""
    present = [key for key in keys if handle.has_param(key)]
    if _given(handle, has):
        if len(present) == len(keys):
            return [read_number(handle, key, 0.0, minimum) for key in keys]
        LOGGER.warning(
            "parameters %s: %s is true, but of %s only %s are set; they are ignored, set all of them",
            handle.namespace,
            has,
            ", ".join(keys),
            ", ".join(present) or "none",
        )
    elif present and not handle.has_param(has):
        LOGGER.warning(
            "parameters %s: %s without %s: true; they are ignored, set it", handle.namespace, ", ".join(present), has
        )
    return None


def _largest(handle: NodeHandle, what: str, known: float) -> float:
    largest = _complete(handle, f"has_{what}_limits", (f"max_{what}",), 0.0)
    if largest is not None:
        return largest[0]
    return INFINITY if _given(handle, f"has_{what}_limits") is False else known


def soft_limits_with_parameters(
    name: str, limits: SoftJointLimits | None, root_nh: NodeHandle
) -> SoftJointLimits | None:
    """`limits`, or what `joint_limits/<name>/` puts in their place; None when neither is there.

    Raises:
        ParameterError: a value is not a number, or the range is none.
    """
    handle = root_nh.child(f"joint_limits/{name}")
    values = _complete(handle, "has_soft_limits", SOFT_LIMIT_KEYS)
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
            f"parameters {handle.namespace}: k_position is {k_position} and k_velocity {k_velocity}; "
            "neither may be negative"
        )
    return SoftJointLimits(lower, upper, k_position, k_velocity)
