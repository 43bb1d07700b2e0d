# SPDX-License-Identifier: BSD-3-Clause
"""Quintic polynomials between trajectory points: coefficients, values and samples of the curve.

The functions are compiled, because the overhead of NumPy calls dominates for a few hundred points.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


@njit(cache=True, nogil=True)
def quintic_coefficients(times: Array, positions: Array, velocities: Array, accelerations: Array) -> Array:
    """Returns the polynomial coefficients between points, lowest power first, shape (n - 1, 6, joints).

    The polynomial of a segment takes the time since the start of the segment.

    Args:
        times: Times of the points, shape (n,) [s].
        positions: Joint positions, shape (n, joints) [rad or m].
        velocities: Joint velocities, shape (n, joints) [rad/s or m/s].
        accelerations: Joint accelerations, shape (n, joints) [rad/s^2 or m/s^2].
    """
    count, joints = positions.shape
    result = np.empty((count - 1, 6, joints))
    for i in range(count - 1):
        span = times[i + 1] - times[i]
        for j in range(joints):
            slope = (positions[i + 1, j] - positions[i, j]) / span
            v0, v1 = velocities[i, j], velocities[i + 1, j]
            a0, a1 = accelerations[i, j] * span, accelerations[i + 1, j] * span
            result[i, 0, j], result[i, 1, j], result[i, 2, j] = positions[i, j], v0, 0.5 * a0 / span
            result[i, 3, j] = (10.0 * slope - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1) / span**2
            result[i, 4, j] = (-15.0 * slope + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1) / span**3
            result[i, 5, j] = (6.0 * slope - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1) / span**4
    return result


@njit(cache=True, nogil=True)
def curve_values(times: Array, coefficients: Array, sample_times: Array, order_count: int) -> Array:
    """Returns positions, velocities, accelerations and jerks of the curve, shape (order_count, m, joints).

    Args:
        times: Times of the points, shape (n,), n > 1 [s].
        coefficients: Polynomial coefficients, shape (n - 1, 6, joints).
        sample_times: Times of the samples, shape (m,), clipped to the duration of the motion [s].
        order_count: Number of returned quantities: 1 for positions only, up to 4 for all.
    """
    joints = coefficients.shape[2]
    result = np.empty((order_count, len(sample_times), joints))
    last = len(times) - 2
    for k in range(len(sample_times)):
        segment = min(max(np.searchsorted(times, sample_times[k], side="right") - 1, 0), last)
        t = min(max(sample_times[k], times[0]), times[last + 1]) - times[segment]
        for j in range(joints):
            c1, c2, c3 = coefficients[segment, 1, j], coefficients[segment, 2, j], coefficients[segment, 3, j]
            c4, c5 = coefficients[segment, 4, j], coefficients[segment, 5, j]
            result[0, k, j] = coefficients[segment, 0, j] + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            if order_count > 1:
                result[1, k, j] = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
            if order_count > 2:
                result[2, k, j] = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
            if order_count > 3:
                result[3, k, j] = 6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5)
    return result


@njit(cache=True, nogil=True)
def curve_samples(times: Array, coefficients: Array, positions: Array, velocities: Array, step: float) -> Array:
    """Returns positions along the curve, shape (m, joints), in joint steps of about `step`.

    The number of samples of a segment follows from the displacement and from the maximum speed at its ends.

    Args:
        times: Times of the points, shape (n,), n > 1 [s].
        coefficients: Polynomial coefficients, shape (n - 1, 6, joints).
        positions: Positions of the points, shape (n, joints) [rad or m].
        velocities: Velocities of the points, shape (n, joints) [rad/s or m/s].
        step: Approximate maximum joint displacement between samples [rad or m].
    """
    segments, _, joints = coefficients.shape
    counts = np.empty(segments, dtype=np.int64)
    for i in range(segments):
        max_travel, span = 0.0, times[i + 1] - times[i]
        for j in range(joints):
            max_speed = max(abs(velocities[i, j]), abs(velocities[i + 1, j]))
            max_travel = max(max_travel, abs(positions[i + 1, j] - positions[i, j]), span * max_speed)
        counts[i] = max(1, int(np.ceil(max_travel / step)))
    result, row = np.empty((counts.sum() + 1, joints)), 0
    for i in range(segments):
        for k in range(counts[i]):
            t = k * (times[i + 1] - times[i]) / counts[i]
            for j in range(joints):
                c1, c2, c3 = coefficients[i, 1, j], coefficients[i, 2, j], coefficients[i, 3, j]
                c4, c5 = coefficients[i, 4, j], coefficients[i, 5, j]
                result[row, j] = coefficients[i, 0, j] + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            row += 1
    result[row] = positions[segments]
    return result


@njit(cache=True, nogil=True)
def bent_segments(times: Array, coefficients: Array, positions: Array, tolerance: float) -> NDArray[np.bool_]:
    """Returns whether the curve, at thirds of the time, leaves the line between consecutive points, shape (n - 1,).

    Args:
        times: Times of the points, shape (n,) [s].
        coefficients: Polynomial coefficients, shape (n - 1, 6, joints).
        positions: Positions of the points, shape (n, joints) [rad or m].
        tolerance: Maximum joint distance from the straight line [rad or m].
    """
    segments, _, joints = coefficients.shape
    result, offset = np.zeros(segments, dtype=np.bool_), np.empty(joints)
    for i in range(segments):
        for third in range(1, 3):
            t, squared_length, projection = (times[i + 1] - times[i]) * third / 3.0, 0.0, 0.0
            for j in range(joints):
                c1, c2, c3 = coefficients[i, 1, j], coefficients[i, 2, j], coefficients[i, 3, j]
                c4, c5 = coefficients[i, 4, j], coefficients[i, 5, j]
                offset[j] = t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
                displacement = positions[i + 1, j] - positions[i, j]
                squared_length += displacement * displacement
                projection += offset[j] * displacement
            fraction = projection / max(squared_length, 1e-30)
            for j in range(joints):
                if abs(offset[j] - fraction * (positions[i + 1, j] - positions[i, j])) > tolerance:
                    result[i] = True
    return result
