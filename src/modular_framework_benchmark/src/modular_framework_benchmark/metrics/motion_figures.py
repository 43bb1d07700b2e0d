# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a motion: length, duration, smoothness and tracking error, as pure functions of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]


def path_length(positions: npt.ArrayLike) -> float:
    """Returns the length of a path in joint space: the sum of the Euclidean distances of successive points.

    It equals OMPL's `PathGeometric::length` with the distance of a real vector space.

    Args:
        positions: Points, shape (n, joints) [rad, or m for prismatic joints].

    Returns:
        The length [rad]; 0 for fewer than two points.
    """
    points = _points(positions)
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def motion_duration(times_s: npt.ArrayLike) -> float:
    """Returns the time from the first to the last point of a motion [s].

    Args:
        times_s: Increasing times of the points, shape (n,) with n > 0 [s].
    """
    times = np.asarray(times_s, dtype=float)
    if times.size == 0:
        raise ValueError("a motion without points has no duration; give at least one time")
    return float(times[-1] - times[0])


def smoothness(times_s: npt.ArrayLike, positions: npt.ArrayLike) -> float | None:
    """Returns the log dimensionless jerk of a motion in joint space; nearer to zero is smoother.

    The formula is -ln(T^3 / v^2 * integral of norm(jerk)^2 dt), with the duration T and the maximum speed v, from "On
    the analysis of movement smoothness" (Balasubramanian and others, 2015). It is invariant to the amplitude and the
    duration of the motion. A cubic spline interpolates the points, so that the jerk is constant between points.

    Args:
        times_s: Strictly increasing times of the points, shape (n,) [s].
        positions: Points, shape (n, joints) [rad or m].

    Returns:
        A dimensionless number; None for fewer than five points or a motion at rest.
    """
    times, points = np.asarray(times_s, dtype=float), _points(positions)
    if len(times) != len(points):
        raise ValueError(f"there are {len(times)} times for {len(points)} points; give one for each")
    if len(times) < 5 or motion_duration(times) <= 0.0 or not np.ptp(points, axis=0).any():
        return None
    spline = CubicSpline(times, points)
    max_speed = float(np.linalg.norm(spline(np.linspace(times[0], times[-1], 4 * len(times)), 1), axis=1).max())
    jerk_integral = float((spline(times[:-1], 3) ** 2).sum(axis=1) @ np.diff(times))
    return float(-np.log(motion_duration(times) ** 3 / max_speed**2 * jerk_integral))


def rms(errors: npt.ArrayLike) -> float | None:
    """Returns the root mean square of numbers in their unit, or None without numbers.

    Args:
        errors: Numbers of any shape.
    """
    values = np.asarray(errors, dtype=float)
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _points(positions: npt.ArrayLike) -> Array:
    points: Any = np.asarray(positions, dtype=float)
    if points.ndim != 2:
        raise ValueError(f"positions have the shape {points.shape}; give one row per point: (n, joints)")
    return np.asarray(points, dtype=np.float64)
