# SPDX-License-Identifier: BSD-3-Clause
"""Odometry of a base on a plane, from the motion of its wheels."""

from __future__ import annotations

import math
from collections import deque

SHORTEST_PERIOD_S = 1e-4
"""Velocities cannot be estimated from a shorter time [s]."""
SMALL_ANGLE = 1e-4
"""Below it the first terms of the series are exact to double precision [rad]."""


def arc(forward: float, sideways: float, turn: float) -> tuple[float, float]:
    """Displacement of a base that moves at constant velocities, in its frame at the beginning [m].

    It is the exponential of a planar twist; for `sideways` 0 an arc of radius forward / turn.

    Args:
        forward: way along x [m].
        sideways: way along y [m].
        turn: angle [rad].
    """
    if abs(turn) < SMALL_ANGLE:
        sine, versine = 1.0 - turn * turn / 6.0, turn / 2.0
    else:
        sine, versine = math.sin(turn) / turn, 2.0 * math.sin(0.5 * turn) ** 2 / turn
    return sine * forward - versine * sideways, versine * forward + sine * sideways


class PlanarOdometry:
    """Pose of the base in the frame where it began, and its velocities in its own frame.

    Args:
        window: over how many cycles estimated velocities are averaged.

    Attributes:
        x: [m].
        y: [m].
        heading: angle from x [rad], not wrapped.
        linear: velocity along the x axis of the base [m/s].
        lateral: velocity along its y axis [m/s].
        angular: velocity about its z axis [rad/s].
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

    def move(self, forward: float, turn: float, time_s: float) -> None:
        """Updates the pose by a measured displacement.

        Args:
            forward: way since the last call [m].
            turn: angle since the last call [rad].
            time_s: time of the cycle [s].
        """
        self._advance(forward, 0.0, turn)
        period_s = time_s - self._time_s
        if period_s < SHORTEST_PERIOD_S:
            return
        self._time_s = time_s
        self._linear.append(forward / period_s)
        self._angular.append(turn / period_s)
        self.linear = sum(self._linear) / len(self._linear)
        self.angular = sum(self._angular) / len(self._angular)

    def move_at(self, linear: float, lateral: float, angular: float, time_s: float) -> None:
        """Updates the pose by velocities that are in force since the last call.

        Args:
            linear: along the x axis of the base [m/s].
            lateral: along its y axis [m/s].
            angular: about its z axis [rad/s].
            time_s: time of the cycle [s].
        """
        period_s = time_s - self._time_s
        self._time_s = time_s
        self.linear, self.lateral, self.angular = linear, lateral, angular
        self._advance(linear * period_s, lateral * period_s, angular * period_s)

    def _advance(self, forward: float, sideways: float, turn: float) -> None:
        ahead, left = arc(forward, sideways, turn)
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        self.x += ahead * cosine - left * sine
        self.y += ahead * sine + left * cosine
        self.heading += turn
