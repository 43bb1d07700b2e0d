# SPDX-License-Identifier: BSD-3-Clause
"""Forward and inverse kinematics of a base with four steered wheels.

The order of the wheels is front left, front right, rear left, rear right. Each wheel steers about a vertical axis, and
is mounted at the distance `steering_offset` from this axis, away from the base's centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SIDES = (1.0, -1.0, 1.0, -1.0)
"""Side of each wheel, 1 left, -1 right."""
ENDS = (1.0, 1.0, -1.0, -1.0)
"""End of each wheel, 1 front, -1 rear."""
MAX_AXLE_SPEED_RATIO = 2.0
"""Maximum ratio of an axle's speed to the speed of the base's centre. The ratio is exceeded if front and rear steer in
opposite directions by more than about 60 degrees; the base is then slowed down."""


@dataclass(frozen=True, slots=True)
class PlanarTwist:
    """Velocity of the centre of a base, in the base frame.

    Attributes:
        linear: Velocity along x [m/s].
        lateral: Velocity along y [m/s].
        angular: Angular velocity about z [rad/s].
    """

    linear: float = 0.0
    lateral: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class FourWheelGeometry:
    """Geometry of the wheels.

    Attributes:
        track: Distance between left and right wheels [m].
        wheel_base: Distance between the axles [m].
        wheel_radius: Wheel radius [m].
        steering_offset: Distance of each wheel from its steering axis [m].
    """

    track: float
    wheel_base: float
    wheel_radius: float
    steering_offset: float

    def twist_of_axles(self, speed: float, front: float, rear: float) -> PlanarTwist:
        """Returns the motion of the base for a speed of its centre and steering angles of its axles.

        Args:
            speed: Speed of the base's centre [m/s].
            front: Angle of the front axle, -pi/2 to pi/2 [rad].
            rear: Angle of the rear axle, -pi/2 to pi/2 [rad].
        """
        front_slope, rear_slope = math.tan(front), math.tan(rear)
        slope = (front_slope + rear_slope) / 2.0
        linear = speed / math.hypot(1.0, slope)
        max_axle_speed = abs(linear) * max(math.hypot(1.0, front_slope), math.hypot(1.0, rear_slope))
        if max_axle_speed > MAX_AXLE_SPEED_RATIO * abs(speed):
            linear *= MAX_AXLE_SPEED_RATIO * abs(speed) / max_axle_speed
        return PlanarTwist(linear, linear * slope, linear * (front_slope - rear_slope) / self.wheel_base)

    def axes(self) -> list[tuple[float, float]]:
        """Returns the positions of the steering axes relative to the base's centre [m]."""
        half = self.track / 2.0 - self.steering_offset
        return [(end * self.wheel_base / 2.0, side * half) for end, side in zip(ENDS, SIDES, strict=True)]

    def wheels(self, twist: PlanarTwist) -> tuple[list[float], list[float]]:
        """Returns steering angles [rad] and wheel velocities [rad/s] for a motion of the base."""
        angles, velocities = [], []
        for (x, y), side in zip(self.axes(), SIDES, strict=True):
            vx, vy = twist.linear - twist.angular * y, twist.lateral + twist.angular * x
            speed = math.copysign(math.hypot(vx, vy), vx if vx != 0.0 else 1.0)
            if vx != 0.0:
                angles.append(math.atan(vy / vx))
            else:
                angles.append(math.copysign(math.pi / 2.0, vy) if vy != 0.0 else 0.0)
            velocities.append((speed - side * twist.angular * self.steering_offset) / self.wheel_radius)
        return angles, velocities

    def twist(self, angles: Sequence[float], velocities: Sequence[float]) -> PlanarTwist:
        """Returns the least-squares motion of the base for wheels that roll without slip.

        Args:
            angles: Steering angles [rad].
            velocities: Wheel velocities [rad/s].
        """
        rows, values = [], []
        for (x, y), side, angle, velocity in zip(self.axes(), SIDES, angles, velocities, strict=True):
            cosine, sine = math.cos(angle), math.sin(angle)
            rows.append((cosine, sine, x * sine - y * cosine - side * self.steering_offset))  # rolling direction
            rows.append((-sine, cosine, x * cosine + y * sine))  # lateral direction
            values += [velocity * self.wheel_radius, 0.0]
        linear, lateral, angular = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0].tolist()
        return PlanarTwist(linear, lateral, angular)


def axle_angle(left: float, right: float) -> float:
    """Returns the angle of an axle's centre [rad]; its slope is the harmonic mean of the slopes of both wheels."""
    slopes = math.tan(left), math.tan(right)
    if slopes[0] * slopes[1] <= 0.0:  # the harmonic mean is undefined if a wheel is straight or the sides differ
        return (left + right) / 2.0
    return math.atan(2.0 * slopes[0] * slopes[1] / (slopes[0] + slopes[1]))
