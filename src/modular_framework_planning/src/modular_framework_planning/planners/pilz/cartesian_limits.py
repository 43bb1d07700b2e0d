# SPDX-License-Identifier: BSD-3-Clause
"""Cartesian velocity limits of LIN and CIRC motions from `robot_description_planning/cartesian_limits`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_planning.errors import ModelError

KEYS = ("max_trans_vel", "max_trans_acc", "max_trans_dec", "max_rot_vel")


@dataclass(frozen=True, slots=True)
class CartesianLimits:
    """Cartesian limits of a link.

    Attributes:
        velocity: Maximum translational velocity [m/s].
        acceleration, deceleration: Maximum translational acceleration and deceleration, both positive [m/s^2].
        rotation_velocity: Maximum angular velocity [rad/s]; angular accelerations have the same ratio to it as
            translational accelerations have to `velocity`.
    """

    velocity: float
    acceleration: float
    deceleration: float
    rotation_velocity: float

    @property
    def metres_per_radian(self) -> float:
        """Translation that takes as long as a rotation by one radian [m/rad]."""
        return self.velocity / self.rotation_velocity


def read_cartesian_limits(entries: Mapping[str, Any], source_name: str = "cartesian_limits") -> CartesianLimits:
    """Reads the four limits.

    Raises:
        ModelError: Lists every key that is missing or has an invalid value.
    """
    faults = []
    for key in KEYS:
        value = entries.get(key)
        sign = -1.0 if key == "max_trans_dec" else 1.0
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
            or (sign * value <= 0.0)
        ):
            got = "missing" if key not in entries else repr(value)
            faults.append(f"{key} is {got}; it must be a number {'below' if sign < 0 else 'above'} 0")
    if faults:
        raise ModelError(f"{source_name}: {'; '.join(faults)}; see pilz_cartesian_limits.yaml of a config package")
    return CartesianLimits(
        float(entries["max_trans_vel"]),
        float(entries["max_trans_acc"]),
        -float(entries["max_trans_dec"]),
        float(entries["max_rot_vel"]),
    )
