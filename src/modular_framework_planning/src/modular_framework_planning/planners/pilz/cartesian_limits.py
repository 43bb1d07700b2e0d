# SPDX-License-Identifier: BSD-3-Clause
"""Limits of a tool's speed along lines and arcs, as `robot_description_planning/cartesian_limits` gives them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_planning.errors import ModelError

KEYS = ("max_trans_vel", "max_trans_acc", "max_trans_dec", "max_rot_vel")


@dataclass(frozen=True, slots=True)
class CartesianLimits:
    """Limits of a link's motion.

    Attributes:
        velocity: translation [m/s].
        acceleration, deceleration: translation, both above 0 [m/s^2].
        rotation_velocity: [rad/s]; rotation speeds up in the same ratio to it as translation does to its own.
    """

    velocity: float
    acceleration: float
    deceleration: float
    rotation_velocity: float

    @property
    def metres_per_radian(self) -> float:
        """Length of the translation that takes as long as a turn of one radian."""
        return self.velocity / self.rotation_velocity


def read_cartesian_limits(entries: Mapping[str, Any], where: str = "cartesian_limits") -> CartesianLimits:
    """Reads the four limits.

    Raises:
        ModelError: lists every key that is missing or has a value that cannot be.
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
            faults.append(f"{key} is {got}; a number {'below' if sign < 0 else 'above'} 0 is needed")
    if faults:
        raise ModelError(f"{where}: {'; '.join(faults)}; see pilz_cartesian_limits.yaml of a config package")
    return CartesianLimits(
        float(entries["max_trans_vel"]),
        float(entries["max_trans_acc"]),
        -float(entries["max_trans_dec"]),
        float(entries["max_rot_vel"]),
    )
