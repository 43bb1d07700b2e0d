# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits for planning: the URDF's limits, overridden by joint_limits.yaml as in MoveIt."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from modular_framework_urdf.robot import Joint

DEFAULT_VELOCITY = 1.0  # [rad/s or m/s]
NO_VELOCITY_LIMIT = 1.0e6  # [rad/s or m/s]; larger velocities count as no limit
DEFAULT_ACCELERATION = 1.0  # [rad/s^2 or m/s^2]
DEFAULT_JERK = 1000.0  # [rad/s^3 or m/s^3]
ROUNDING_TOLERANCE = 1.0e-3  # absolute for positions [rad or m], relative for velocities; covers rounded values


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of a joint.

    Attributes:
        lower: Lower position limit [rad or m].
        upper: Upper position limit [rad or m].
        velocity: Velocity limit [rad/s or m/s].
        acceleration: Acceleration limit [rad/s^2 or m/s^2].
        deceleration: Deceleration limit above 0 [rad/s^2 or m/s^2]; None if equal to the acceleration limit.
        jerk: Jerk limit [rad/s^3 or m/s^3].
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    deceleration: float | None = None
    jerk: float = DEFAULT_JERK

    @property
    def braking(self) -> float:
        """Deceleration limit above 0 [rad/s^2 or m/s^2]."""
        return self.acceleration if self.deceleration is None else self.deceleration


def described_limits(joint: Joint) -> JointLimits:
    """Returns a joint's limits in the URDF, including soft limits; the position of a continuous joint is unlimited."""
    lower, upper = (0.0, 0.0) if joint.limit is None else (joint.limit.lower, joint.limit.upper)
    if joint.safety is not None:
        lower = lower if joint.safety.soft_lower_limit is None else max(lower, joint.safety.soft_lower_limit)
        upper = upper if joint.safety.soft_upper_limit is None else min(upper, joint.safety.soft_upper_limit)
    if joint.kind == "continuous":
        lower, upper = -math.inf, math.inf
    velocity = (joint.limit and joint.limit.velocity) or 0.0
    is_known = 0.0 < velocity < NO_VELOCITY_LIMIT
    return JointLimits(lower, upper, velocity if is_known else DEFAULT_VELOCITY, DEFAULT_ACCELERATION)


def known_limits(joint: Joint, entry: Mapping[str, Any]) -> JointLimits:
    """Returns a joint's limits in joint_limits.yaml and the URDF; a velocity or acceleration without limit is infinite.

    Args:
        joint: Joint of the URDF.
        entry: Entry of joint_limits.yaml, see `overwritten`.

    Raises:
        ValueError: A value of the entry is invalid.
    """
    limits, _ = overwritten(joint.name, described_limits(joint), entry, joint.kind == "continuous")
    is_described = joint.limit is not None and 0.0 < (joint.limit.velocity or 0.0) < NO_VELOCITY_LIMIT
    has_velocity = entry.get("has_velocity_limits", True) and ("max_velocity" in entry or is_described)
    has_acceleration = entry.get("has_acceleration_limits", True) and "max_acceleration" in entry
    return replace(
        limits,
        velocity=limits.velocity if has_velocity else math.inf,
        acceleration=limits.acceleration if has_acceleration else math.inf,
    )


def _value(name: str, entry: Mapping[str, Any], flag: bool, key: str) -> float | None:
    if not flag or key not in entry:
        return None
    value = entry[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"joint_limits/{name}/{key}: {value!r} is not a finite number")
    return float(value)


def overwritten(
    name: str, limits: JointLimits, entry: Mapping[str, Any], is_endless: bool = False
) -> tuple[JointLimits, tuple[str, ...]]:
    """Returns the limits overridden by joint_limits.yaml, and notes about looser and ignored limits.

    Args:
        name: Joint name, for error messages.
        limits: Limits in the URDF.
        entry: Entry of joint_limits.yaml. Position limits require `has_position_limits`; other limits apply unless
            their flag is false. A false `has_velocity_limits` also removes the URDF's limit, as in MoveIt's
            RobotModelLoader.
        is_endless: Whether the joint is continuous and cannot have position limits.

    Raises:
        ValueError: A value is not a number, has the wrong sign, or the position range is empty.
    """
    has_bounds = bool(entry.get("has_position_limits", False))
    low, high = (_value(name, entry, has_bounds and not is_endless, key) for key in ("min_position", "max_position"))
    lower, upper = limits.lower if low is None else low, limits.upper if high is None else high
    velocity, acceleration, jerk = (
        _value(name, entry, entry.get(f"has_{kind}_limits", True), f"max_{kind}")
        for kind in ("velocity", "acceleration", "jerk")
    )
    has_velocity = bool(entry.get("has_velocity_limits", True))
    if not has_velocity:
        velocity = DEFAULT_VELOCITY
    braking_flag = "has_deceleration_limits" if "has_deceleration_limits" in entry else "has_deceleration"
    deceleration = _value(name, entry, entry.get(braking_flag, True), "max_deceleration")
    if deceleration is not None and deceleration >= 0:
        raise ValueError(f"joint_limits/{name}/max_deceleration: {deceleration}; it must be below 0")
    if lower > upper or any(value is not None and value <= 0 for value in (velocity, acceleration, jerk)):
        raise ValueError(
            f"joint_limits/{name}: bounds [{lower}, {upper}], velocity {velocity}, acceleration "
            f"{acceleration}, jerk {jerk}; the lower bound must not exceed the upper, and the rest must be above 0"
        )
    result = JointLimits(
        lower,
        upper,
        limits.velocity if velocity is None else velocity,
        limits.acceleration if acceleration is None else acceleration,
        None if deceleration is None else -deceleration,
        DEFAULT_JERK if jerk is None else jerk,
    )
    notes = [
        f"joint_limits/{name}: {key} {new:g} is looser than the URDF's {old:g}, but is used"
        for key, new, old, is_looser in (
            ("min_position", lower, limits.lower, lower < limits.lower - ROUNDING_TOLERANCE),
            ("max_position", upper, limits.upper, upper > limits.upper + ROUNDING_TOLERANCE),
            (
                "max_velocity",
                result.velocity,
                limits.velocity,
                has_velocity and result.velocity > limits.velocity * (1.0 + ROUNDING_TOLERANCE),
            ),
        )
        if is_looser
    ]
    if not has_velocity and limits.velocity != DEFAULT_VELOCITY:
        notes.append(
            f"joint_limits/{name}: has_velocity_limits is false, so that the default {DEFAULT_VELOCITY:g} replaces the "
            f"URDF's {limits.velocity:g}"
        )
    if has_bounds and is_endless:
        notes.append(f"joint_limits/{name}: has_position_limits is ignored, because the joint is continuous")
    return result, tuple(notes)
