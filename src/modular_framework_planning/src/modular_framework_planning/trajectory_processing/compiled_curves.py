# SPDX-License-Identifier: BSD-3-Clause
"""The quintic polynomials between the points of a timed motion, compiled: coefficients, values, samples of the curve.

They are asked some times for each plan, of some hundred points: NumPy's overhead would be most of the time.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array


@njit(cache=True, nogil=True)
def quintic_coefficients(times: Array, positions: Array, velocities: Array, accelerations: Array) -> Array:
    """Returns the polynomials between points, lowest power first, shape (n - 1, 6, joints).

    Args: times of shape (n,) [s]; the others of shape (n, joints) [rad or m, per s, per s^2].
    """
    count, joints = positions.shape
    result = np.empty((count - 1, 6, joints))
    for i in range(count - 1):
        span = times[i + 1] - times[i]
        for j in range(joints):
            way = (positions[i + 1, j] - positions[i, j]) / span
            v0, v1 = velocities[i, j], velocities[i + 1, j]
            a0, a1 = accelerations[i, j] * span, accelerations[i + 1, j] * span
            result[i, 0, j], result[i, 1, j], result[i, 2, j] = positions[i, j], v0, 0.5 * a0 / span
            result[i, 3, j] = (10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1) / span**2
            result[i, 4, j] = (-15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1) / span**3
            result[i, 5, j] = (6.0 * way - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1) / span**4
    return result


@njit(cache=True, nogil=True)
def curve_values(times: Array, coefficients: Array, wanted: Array, orders: int) -> Array:
    """Returns positions, velocities, accelerations and jerks at some times, shape (4, m, joints), or the first of them.

    Args: times of the points, shape (n,), n > 1 [s]; coefficients of shape (n - 1, 6, joints); wanted times of shape
        (m,) [s], before and after the motion it rests at its ends' values; orders, how many of the four are returned.
    """
    joints = coefficients.shape[2]
    result = np.empty((orders, len(wanted), joints))
    last = len(times) - 2
    for k in range(len(wanted)):
        segment = min(max(np.searchsorted(times, wanted[k], side="right") - 1, 0), last)
        t = min(max(wanted[k], times[0]), times[last + 1]) - times[segment]
        for j in range(joints):
            c1, c2, c3 = coefficients[segment, 1, j], coefficients[segment, 2, j], coefficients[segment, 3, j]
            c4, c5 = coefficients[segment, 4, j], coefficients[segment, 5, j]
            result[0, k, j] = coefficients[segment, 0, j] + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            if orders > 1:
                result[1, k, j] = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
            if orders > 2:
                result[2, k, j] = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
            if orders > 3:
                result[3, k, j] = 6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5)
    return result


@njit(cache=True, nogil=True)
def curve_samples(times: Array, coefficients: Array, positions: Array, velocities: Array, step: float) -> Array:
    """Returns positions along the curve, shape (m, joints), neighbours about `step` apart or nearer.

    Args: times, positions and velocities of the points, shapes (n,), (n, joints) twice, n > 1; coefficients of shape
        (n - 1, 6, joints); step of any joint [rad or m].
    """
    segments, _, joints = coefficients.shape
    counts = np.empty(segments, dtype=np.int64)
    for i in range(segments):
        reach, span = 0.0, times[i + 1] - times[i]
        for j in range(joints):
            fastest = max(abs(velocities[i, j]), abs(velocities[i + 1, j]))
            reach = max(reach, abs(positions[i + 1, j] - positions[i, j]), span * fastest)
        counts[i] = max(1, int(np.ceil(reach / step)))
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
    """Returns whether the curve leaves the straight line between two points, shape (n - 1,).

    Args: times and positions of the points, shapes (n,) and (n, joints); coefficients of shape (n - 1, 6, joints);
        tolerance, the distance of any joint that counts as none [rad or m].
    """
    segments, _, joints = coefficients.shape
    result, offset = np.zeros(segments, dtype=np.bool_), np.empty(joints)
    for i in range(segments):
        for part in range(1, 3):
            t, square, along = (times[i + 1] - times[i]) * part / 3.0, 0.0, 0.0
            for j in range(joints):
                c1, c2, c3 = coefficients[i, 1, j], coefficients[i, 2, j], coefficients[i, 3, j]
                c4, c5 = coefficients[i, 4, j], coefficients[i, 5, j]
                offset[j] = t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
                way = positions[i + 1, j] - positions[i, j]
                square += way * way
                along += offset[j] * way
            share = along / max(square, 1e-30)
            for j in range(joints):
                if abs(offset[j] - share * (positions[i + 1, j] - positions[i, j])) > tolerance:
                    result[i] = True
    return result
