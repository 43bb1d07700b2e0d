# SPDX-License-Identifier: BSD-3-Clause
"""Planar odometry of a base from the motion of its wheels."""

from __future__ import annotations

import math
from collections import deque

MIN_PERIOD_S = 1e-4
"""Minimum time for an estimate of velocities [s]."""
SMALL_ANGLE = 1e-4
"""Angle below which the first terms of the series are exact to double precision [rad]."""


def arc(forward: float, sideways: float, rotation: float) -> tuple[float, float]:
    """Returns the displacement of a base that moves at constant velocities, in its initial frame [m].

    The displacement is the exponential of a planar twist; for `sideways` 0, an arc of radius forward / turn.

    Args:
        forward: Integrated velocity along x [m].
        sideways: Integrated velocity along y [m].
        rotation: Rotation angle [rad].
    """
    if abs(rotation) < SMALL_ANGLE:
        sine, versine = 1.0 - rotation * rotation / 6.0, rotation / 2.0
    else:
        sine, versine = math.sin(rotation) / rotation, 2.0 * math.sin(0.5 * rotation) ** 2 / rotation
    return sine * forward - versine * sideways, versine * forward + sine * sideways


class PlanarOdometry:
    """Pose of the base in its initial frame, and velocities in the base frame.

    Args:
        window: Number of cycles over which estimated velocities are averaged.

    Attributes:
        x: Position [m].
        y: Position [m].
        heading: Angle from the x axis, not wrapped [rad].
        linear: Velocity along the base's x axis [m/s].
        lateral: Velocity along the base's y axis [m/s].
        angular: Angular velocity about the z axis [rad/s].
    """

    def __init__(self, window: int) -> None:
        self.x = self.y = self.heading = 0.0
        self.linear = self.lateral = self.angular = 0.0
        self._linear: deque[float] = deque(maxlen=window)
        self._angular: deque[float] = deque(maxlen=window)
        self._time_s = 0.0

    def start(self, time_s: float) -> None:
        """Clears the velocities; the pose stays."""
        self._linear.clear()
        self._angular.clear()
        self.linear = self.lateral = self.angular = 0.0
        self._time_s = time_s

    def move(self, forward: float, rotation: float, time_s: float) -> None:
        """Updates the pose by a measured displacement.

        Args:
            forward: Distance since the last call [m].
            rotation: Rotation since the last call [rad].
            time_s: Time of the cycle.
        """
        self._advance(forward, 0.0, rotation)
        period_s = time_s - self._time_s
        if period_s < MIN_PERIOD_S:
            return
        self._time_s = time_s
        self._linear.append(forward / period_s)
        self._angular.append(rotation / period_s)
        self.linear = sum(self._linear) / len(self._linear)
        self.angular = sum(self._angular) / len(self._angular)

    def move_at(self, linear: float, lateral: float, angular: float, time_s: float) -> None:
        """Updates the pose by constant velocities since the last call.

        Args:
            linear: Velocity along the base's x axis [m/s].
            lateral: Velocity along the base's y axis [m/s].
            angular: Angular velocity about the z axis [rad/s].
            time_s: Time of the cycle.
        """
        period_s = time_s - self._time_s
        self._time_s = time_s
        self.linear, self.lateral, self.angular = linear, lateral, angular
        self._advance(linear * period_s, lateral * period_s, angular * period_s)

    def _advance(self, forward: float, sideways: float, rotation: float) -> None:
        dx, dy = arc(forward, sideways, rotation)
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        self.x += dx * cosine - dy * sine
        self.y += dx * sine + dy * cosine
        self.heading += rotation
