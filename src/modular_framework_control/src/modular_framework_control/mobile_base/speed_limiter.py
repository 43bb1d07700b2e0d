# SPDX-License-Identifier: BSD-3-Clause
"""Limits of velocity, acceleration and jerk of a mobile base, under the parameter names of ros_controllers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number

UNLIMITED = (-math.inf, math.inf)
JERK_FACTOR = 2.0
"""Factor on jerk limits: ros_controllers has it too, and its users' limits are tuned with it."""


def clamped(value: float, lowest: float, highest: float) -> float:
    """The value in the range that is nearest to `value`."""
    return min(max(value, lowest), highest)


@dataclass(frozen=True, slots=True)
class SpeedLimiter:
    """Keeps one velocity of a base, linear or angular, within its limits from one cycle to the next.

    Attributes:
        velocity: smallest and largest [m/s|rad/s].
        acceleration: smallest and largest [m/s^2|rad/s^2].
        jerk: smallest and largest [m/s^3|rad/s^3].
    """

    velocity: tuple[float, float] = UNLIMITED
    acceleration: tuple[float, float] = UNLIMITED
    jerk: tuple[float, float] = UNLIMITED

    def limit(self, wanted: float, last: float, before_last: float, period_s: float) -> float:
        """The velocity to command: the jerk is limited first, then the acceleration, then the velocity.

        Args:
            wanted: the requested velocity.
            last: velocity commanded in the last cycle.
            before_last: velocity commanded in the cycle before that.
            period_s: time since the last cycle [s].
        """
        value = wanted
        if self.jerk != UNLIMITED:
            change = last - before_last
            step_s2 = JERK_FACTOR * period_s * period_s
            value = last + change + clamped(value - last - change, self.jerk[0] * step_s2, self.jerk[1] * step_s2)
        if self.acceleration != UNLIMITED:
            value = last + clamped(value - last, self.acceleration[0] * period_s, self.acceleration[1] * period_s)
        return clamped(value, *self.velocity)


def read_speed_limiter(limits_nh: NodeHandle) -> SpeedLimiter:
    """The limits below `linear/x` or `angular/z`.

    `has_velocity_limits`, `max_velocity`, `min_velocity` (default minus the largest), likewise `..._acceleration` and
    `..._jerk`.

    Raises:
        ParameterError: a limit that is switched on has no largest value, or its range does not hold 0.
    """
    return SpeedLimiter(*(_range(limits_nh, what) for what in ("velocity", "acceleration", "jerk")))


def _range(limits_nh: NodeHandle, what: str) -> tuple[float, float]:
    switch, largest, smallest = f"has_{what}_limits", f"max_{what}", f"min_{what}"
    if not read_bool(limits_nh, switch, False):
        return UNLIMITED
    where = join_names(limits_nh.namespace, largest)
    if not limits_nh.has_param(largest):
        raise ParameterError(
            f"parameter {where} is not set although {switch} is true; give the largest {what}, or set {switch} to false"
        )
    highest = read_number(limits_nh, largest, 0.0, None)
    lowest = read_number(limits_nh, smallest, -highest, None)
    if not lowest <= 0.0 <= highest:
        raise ParameterError(
            f"parameters {where} and {smallest}: got {highest} and {lowest}; the largest {what} must "
            "be at least 0 and the smallest at most 0, or the base could not stand still"
        )
    return lowest, highest
