# SPDX-License-Identifier: BSD-3-Clause
"""Combines the limits of the URDF with those of joint_limits.yaml; the file may only tighten them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_planning.errors import ModelError

DEFAULT_VELOCITY = 1.0  # [rad/s] or [m/s] where no source names one
DEFAULT_ACCELERATION = 1.0  # [rad/s^2] or [m/s^2] where no source names one
BEYOND_BOUND = 1.0e-4  # [rad or m]; a goal this little beyond a joint's bound means the bound (3.1416 for pi)
DEFAULT_JERK = 1000.0  # [rad/s^3] or [m/s^3] where no source names one


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of one joint; positions [rad or m], velocity [1/s], acceleration [1/s^2], jerk [1/s^3].

    Attributes:
        deceleration: largest deceleration, above 0; None if it equals the acceleration.
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    deceleration: float | None = None
    jerk: float = DEFAULT_JERK

    @property
    def braking(self) -> float:
        """Largest deceleration [1/s^2], above 0."""
        return self.acceleration if self.deceleration is None else self.deceleration


def _value(name: str, entry: Mapping[str, Any], flag: str, key: str) -> float | None:
    if not entry.get(flag, key in entry) or key not in entry:
        return None
    value = entry[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ModelError(f"joint_limits/{name}/{key}: {value!r} is not a finite number")
    return float(value)


def tighten(name: str, limits: JointLimits, entry: Mapping[str, Any]) -> JointLimits:
    """Returns the limits after the file's entry for this joint.

    Raises:
        ModelError: a value is not a number, has the wrong sign, or leaves no room between the bounds.
    """
    lower, upper = limits.lower, limits.upper
    low, high = (_value(name, entry, "has_position_limits", key) for key in ("min_position", "max_position"))
    lower = lower if low is None else max(lower, low)
    upper = upper if high is None else min(upper, high)
    velocity = _value(name, entry, "has_velocity_limits", "max_velocity")
    acceleration = _value(name, entry, "has_acceleration_limits", "max_acceleration")
    braking_flag = "has_deceleration_limits" if "has_deceleration_limits" in entry else "has_deceleration"
    deceleration = _value(name, entry, braking_flag, "max_deceleration")
    if deceleration is not None and deceleration >= 0:
        raise ModelError(f"joint_limits/{name}/max_deceleration: {deceleration}; it must be below 0")
    jerk = _value(name, entry, "has_jerk_limits", "max_jerk")
    if lower > upper or any(value is not None and value <= 0 for value in (velocity, acceleration, jerk)):
        raise ModelError(
            f"joint_limits/{name}: bounds [{lower}, {upper}], velocity {velocity}, acceleration "
            f"{acceleration}, jerk {jerk}; the bounds must leave room and the rest must be above 0"
        )
    return JointLimits(
        lower,
        upper,
        limits.velocity if velocity is None else min(velocity, limits.velocity),
        limits.acceleration if acceleration is None else acceleration,
        None if deceleration is None else -deceleration,
        DEFAULT_JERK if jerk is None else jerk,
    )
