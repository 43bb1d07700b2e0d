# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics of a base with four steered wheels: from its motion to steering angles and wheel speeds, and back.

The order of the wheels is front left, front right, rear left, rear right. Each turns about a vertical steering axis and
is mounted outside of that axis, at a distance of `steering_offset`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SIDES = (1.0, -1.0, 1.0, -1.0)
"""Of each wheel: 1 left, -1 right."""
ENDS = (1.0, 1.0, -1.0, -1.0)
"""Of each wheel: 1 front, -1 rear."""
FASTEST_AXLE = 2.0
"""Largest ratio of the speed of an axle to that of the middle of the base. It is reached where front and rear steer in
opposite directions by more than about 60 degrees; beyond, the base is slowed down."""


@dataclass(frozen=True, slots=True)
class PlanarTwist:
    """Velocity of the middle of a base.

    Attributes:
        linear: along its x axis [m/s].
        lateral: along its y axis [m/s].
        angular: about its z axis [rad/s].
    """

    linear: float = 0.0
    lateral: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class FourWheelGeometry:
    """Geometry of the wheels.

    Attributes:
        track: distance between left and right wheels [m].
        wheel_base: distance between the axles [m].
        wheel_radius: [m].
        steering_offset: of each wheel from its steering axis [m].
    """

    track: float
    wheel_base: float
    wheel_radius: float
    steering_offset: float

    def twist_of_axles(self, speed: float, front: float, rear: float) -> PlanarTwist:
        """The motion when the middle of the base has a speed and the middles of the axles steer by two angles.

        Args:
            speed: [m/s].
            front: angle of the front axle [rad], -pi/2 to pi/2.
            rear: angle of the rear axle [rad], likewise.
        """
        front_slope, rear_slope = math.tan(front), math.tan(rear)
        slope = (front_slope + rear_slope) / 2.0
        linear = speed / math.hypot(1.0, slope)
        fastest = abs(linear) * max(math.hypot(1.0, front_slope), math.hypot(1.0, rear_slope))
        if fastest > FASTEST_AXLE * abs(speed):
            linear *= FASTEST_AXLE * abs(speed) / fastest
        return PlanarTwist(linear, linear * slope, linear * (front_slope - rear_slope) / self.wheel_base)

    def axes(self) -> list[tuple[float, float]]:
        """Positions of the steering axes relative to the middle of the base [m]."""
        half = self.track / 2.0 - self.steering_offset
        return [(end * self.wheel_base / 2.0, side * half) for end, side in zip(ENDS, SIDES, strict=True)]

    def wheels(self, twist: PlanarTwist) -> tuple[list[float], list[float]]:
        """Angles of the steering joints [rad] and velocities of the wheels [rad/s] for a motion of the base."""
        angles, velocities = [], []
        for (x, y), side in zip(self.axes(), SIDES, strict=True):
            ahead, left = twist.linear - twist.angular * y, twist.lateral + twist.angular * x
            speed = math.copysign(math.hypot(ahead, left), ahead if ahead != 0.0 else 1.0)
            if ahead != 0.0:
                angles.append(math.atan(left / ahead))
            else:
                angles.append(math.copysign(math.pi / 2.0, left) if left != 0.0 else 0.0)
            velocities.append((speed - side * twist.angular * self.steering_offset) / self.wheel_radius)
        return angles, velocities

    def twist(self, angles: Sequence[float], velocities: Sequence[float]) -> PlanarTwist:
        """The motion of the base that fits best, by least squares, to wheels that roll without slip.

        Args:
            angles: of the steering joints [rad].
            velocities: of the wheels [rad/s].
        """
        rows, values = [], []
        for (x, y), side, angle, velocity in zip(self.axes(), SIDES, angles, velocities, strict=True):
            cosine, sine = math.cos(angle), math.sin(angle)
            rows.append((cosine, sine, x * sine - y * cosine - side * self.steering_offset))  # along the wheel
            rows.append((-sine, cosine, x * cosine + y * sine))  # across it
            values += [velocity * self.wheel_radius, 0.0]
        linear, lateral, angular = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0].tolist()
        return PlanarTwist(linear, lateral, angular)


def axle_angle(left: float, right: float) -> float:
    """Angle of the middle of an axle whose wheels steer by two angles [rad]: its slope is their harmonic mean."""
    slopes = math.tan(left), math.tan(right)
    if slopes[0] * slopes[1] <= 0.0:  # one is straight, or they point to different sides and there is no such mean
        return (left + right) / 2.0
    return math.atan(2.0 * slopes[0] * slopes[1] / (slopes[0] + slopes[1]))
