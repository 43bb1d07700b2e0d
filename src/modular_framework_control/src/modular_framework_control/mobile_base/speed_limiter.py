# SPDX-License-Identifier: BSD-3-Clause
"""Velocity, acceleration and jerk limits of a mobile base, with the parameters of ros_controllers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number

UNLIMITED = (-math.inf, math.inf)
JERK_FACTOR = 2.0
"""Factor on jerk limits, as in ros_controllers, whose users' limits are tuned with this factor."""


def clamp(value: float, lowest: float, highest: float) -> float:
    """Returns the value clamped to a range.

    Args:
        value: Value.
        lowest: Minimum.
        highest: Maximum.
    """
    return min(max(value, lowest), highest)


@dataclass(frozen=True, slots=True)
class SpeedLimiter:
    """Limits of a linear or angular velocity.

    Attributes:
        velocity: Minimum and maximum velocity [m/s|rad/s].
        acceleration: Minimum and maximum acceleration [m/s^2|rad/s^2].
        jerk: Minimum and maximum jerk [m/s^3|rad/s^3].
    """

    velocity: tuple[float, float] = UNLIMITED
    acceleration: tuple[float, float] = UNLIMITED
    jerk: tuple[float, float] = UNLIMITED

    def limit(self, requested: float, last: float, before_last: float, period_s: float) -> float:
        """Returns the requested velocity with limited jerk, then acceleration, then velocity.

        Args:
            requested: Requested velocity [m/s|rad/s].
            last: Velocity commanded in the last cycle [m/s|rad/s].
            before_last: Velocity commanded in the cycle before [m/s|rad/s].
            period_s: Time since the last cycle.
        """
        value = requested
        if self.jerk != UNLIMITED:
            change = last - before_last
            step_s2 = JERK_FACTOR * period_s * period_s
            value = last + change + clamp(value - last - change, self.jerk[0] * step_s2, self.jerk[1] * step_s2)
        if self.acceleration != UNLIMITED:
            value = last + clamp(value - last, self.acceleration[0] * period_s, self.acceleration[1] * period_s)
        return clamp(value, *self.velocity)


def read_speed_limiter(limits_nh: NodeHandle) -> SpeedLimiter:
    """Returns the limits below `linear/x` or `angular/z`.

    Parameters: `has_velocity_limits`, `max_velocity`, `min_velocity` (default: the negative maximum), and the
        corresponding parameters of `acceleration` and `jerk`.

    Raises:
        ParameterError: An enabled limit has no maximum, or its range does not contain 0.
    """
    return SpeedLimiter(*(_range(limits_nh, quantity) for quantity in ("velocity", "acceleration", "jerk")))


def _range(limits_nh: NodeHandle, quantity: str) -> tuple[float, float]:
    switch, largest, smallest = f"has_{quantity}_limits", f"max_{quantity}", f"min_{quantity}"
    if not read_bool(limits_nh, switch, False):
        return UNLIMITED
    where = join_names(limits_nh.namespace, largest)
    if not limits_nh.has_param(largest):
        raise ParameterError(
            f"parameter {where} is not set although {switch} is true; set the maximum {quantity}, "
            f"or set {switch} to false"
        )
    highest = read_number(limits_nh, largest, 0.0, None)
    lowest = read_number(limits_nh, smallest, -highest, None)
    if not lowest <= 0.0 <= highest:
        raise ParameterError(
            f"parameters {where} and {smallest}: got {highest} and {lowest}; the maximum {quantity} must "
            "be at least 0 and the minimum at most 0, so that the base can stop"
        )
    return lowest, highest
