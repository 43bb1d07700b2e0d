# SPDX-License-Identifier: BSD-3-Clause
"""Figures of one motion: length, duration, smoothness, and how well it was followed. Pure functions of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]


def path_length(positions: npt.ArrayLike) -> float:
    """Returns the length of a path through joint space: the sum of the Euclidean distances of successive points.

    It is what OMPL's `PathGeometric::length` gives with the distance of a real vector space.

    Args:
        positions: Points, shape (n, joints) [rad, or m for prismatic joints].

    Returns:
        The length [rad]; 0 for fewer than two points.
    """
    points = _points(positions)
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def motion_duration(times_s: npt.ArrayLike) -> float:
    """Returns the time from the first point of a motion to the last [s].

    Args:
        times_s: Times of its points, increasing, shape (n,) [s]; at least one.
    """
    times = np.asarray(times_s, dtype=float)
    if times.size == 0:
        raise ValueError("a motion without points has no duration; give at least one time")
    return float(times[-1] - times[0])


def smoothness(times_s: npt.ArrayLike, positions: npt.ArrayLike) -> float | None:
    """Returns the log dimensionless jerk of a motion through joint space; nearer to zero is smoother.

    The formula is -ln(T^3 / v^2 * integral of |jerk|^2 dt), with the duration T and the greatest speed v, from "On the
    analysis of movement smoothness" (Balasubramanian and others, 2015). It does not depend on the size or the duration
    of the motion. Between the points the motion is a cubic spline, whose jerk is constant from point to point.

    Args:
        times_s: Times of the points, strictly increasing, shape (n,) [s].
        positions: Points, shape (n, joints) [rad or m].

    Returns:
        A number without unit; None for fewer than five points or a motion that stands still.
    """
    times, points = np.asarray(times_s, dtype=float), _points(positions)
    if len(times) != len(points):
        raise ValueError(f"there are {len(times)} times for {len(points)} points; give one for each")
    if len(times) < 5 or motion_duration(times) <= 0.0 or not np.ptp(points, axis=0).any():
        return None
    spline = CubicSpline(times, points)
    fastest = float(np.linalg.norm(spline(np.linspace(times[0], times[-1], 4 * len(times)), 1), axis=1).max())
    total = float((spline(times[:-1], 3) ** 2).sum(axis=1) @ np.diff(times))
    return float(-np.log(motion_duration(times) ** 3 / fastest**2 * total))


def rms(errors: npt.ArrayLike) -> float | None:
    """Returns the root of the mean square of numbers, [their unit]; None for none.

    Args:
        errors: Numbers, any shape.
    """
    values = np.asarray(errors, dtype=float)
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _points(positions: npt.ArrayLike) -> Array:
    points: Any = np.asarray(positions, dtype=float)
    if points.ndim != 2:
        raise ValueError(f"positions have the shape {points.shape}; give one row a point: (n, joints)")
    return np.asarray(points, dtype=np.float64)
