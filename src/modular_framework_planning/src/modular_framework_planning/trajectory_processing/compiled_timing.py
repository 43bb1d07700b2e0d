# SPDX-License-Identifier: BSD-3-Clause
"""Compiled time-optimal path parameterization (TOPP-RA) of a path with parabolic blends, and its moving average.

The path is divided into intervals with a linear tangent q' and a constant curvature q'' over path position s, and with
a constant path acceleration u. The joint acceleration q' u + q'' x, with x the squared path speed, is then linear over
s in each interval. Its limits therefore hold everywhere if they hold at both ends.

Source: H. Pham, Q.-C. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis",
IEEE Transactions on Robotics 34 (2018).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.compiled_curves import curve_values, quintic_coefficients

_ZERO_TANGENT = 1.0e-10  # a joint with a smaller tangent does not bound the path acceleration
_NODE = 0.7745966692414834  # sqrt(3 / 5): outer node of Gauss quadrature with three nodes, exact up to degree 5
GRID_STEP = 0.02  # maximum length of an interval [rad or m]
MIN_INTERVALS = 12  # minimum number of intervals per straight piece or blend
MIN_JUMP = 0.05  # larger acceleration jumps get a trajectory point; fraction of the limit
SAMPLES_PER_SEGMENT = 24  # sample intervals per segment in the check of the limits
MIN_BLEND_COSINE = -0.9  # minimum cosine between two edges with a blend; the motion stops at sharper reversals
MIN_BLEND = 1.0e-3  # minimum blend size [rad or m]
MAX_BLEND_FRACTION = 0.45  # maximum blend size as a fraction of an edge, which has a blend at both ends


class PathPieces(NamedTuple):
    """A path of m parabolas.

    Attributes:
        breaks: Path position at the ends of the parabolas, shape (m + 1,).
        points, tangents: Joint positions and tangents at the start of each parabola, shape (m, joints).
        curvatures: Curvature of each parabola, shape (m, joints).
    """

    breaks: Array
    points: Array
    tangents: Array
    curvatures: Array


class PathMotion(NamedTuple):
    """Motion along a path from rest to rest in n intervals of constant path acceleration.

    Attributes:
        grid, speeds, times: Path position, path speed and time at the ends of the intervals, shape (n + 1,).
        path_accelerations: Path acceleration of each interval, shape (n,).
        piece_indices: Index of the path piece of each interval, shape (n,).
        areas: Integrals of the joint positions from the start to the ends of the intervals, shape (n + 1, joints).
        jumps: Maximum jump of a joint acceleration at the ends of the intervals, as a fraction of its limit, shape
            (n + 1,).
    """

    grid: Array
    speeds: Array
    times: Array
    path_accelerations: Array
    piece_indices: NDArray[np.int64]
    areas: Array
    jumps: Array


@njit(cache=True, nogil=True)
def _bounds(squared_speed: float, rows: Array, limits: Array) -> tuple[float, float, int, int]:
    """Returns the minimum and maximum path acceleration at a squared speed, and the active rows (-1 if none).

    Row k of `rows` is (a, b) and means -c <= a u + b x <= c, with c the limit of the row. Active row k stands for the
    limit c, active row k + n for the limit -c.
    """
    min_value, max_value, low_row, high_row = -np.inf, np.inf, -1, -1
    count = len(limits)
    for k in range(count):
        a = rows[k, 0]
        if abs(a) < _ZERO_TANGENT:
            continue
        lower = (limits[k] - rows[k, 1] * squared_speed) / a
        upper = (-limits[k] - rows[k, 1] * squared_speed) / a
        lower_row, upper_row = k, k + count
        if lower > upper:
            lower, upper, lower_row, upper_row = upper, lower, upper_row, lower_row
        if lower > min_value:
            min_value, low_row = lower, lower_row
        if upper < max_value:
            max_value, high_row = upper, upper_row
    return min_value, max_value, low_row, high_row


@njit(cache=True, nogil=True)
def _line(active_row: int, rows: Array, limits: Array) -> tuple[float, float]:
    """Returns the bound of an active row on u as offset and slope over x."""
    count = len(limits)
    k = active_row % count
    limit = limits[k] if active_row < count else -limits[k]
    return limit / rows[k, 0], -rows[k, 1] / rows[k, 0]


@njit(cache=True, nogil=True)
def _fastest_start(ceiling: float, step: float, next_max_square: float, rows: Array, limits: Array) -> float:
    """Returns the maximum squared speed at the start of an interval that allows a valid speed at its end.

    The width of the allowed range of u is concave in x and not negative at x = 0. Newton's method from the right
    therefore finds the root of the width in at most as many steps as there are pairs of active rows.

    Args:
        ceiling: Upper bound of the squared speed.
        step: Twice the length of the interval.
        next_max_square: Maximum squared speed at the end of the interval.
        rows: Acceleration constraints, see `_bounds`.
        limits: Limits of the rows.
    """
    x = ceiling
    for k in range(len(limits)):
        if abs(rows[k, 0]) < _ZERO_TANGENT and abs(rows[k, 1]) > _ZERO_TANGENT:
            x = min(x, limits[k] / abs(rows[k, 1]))
    for _ in range(50):
        low, high, low_row, high_row = _bounds(x, rows, limits)
        low_offset, low_slope, high_offset, high_slope = 0.0, 0.0, 0.0, 0.0
        if low_row >= 0:
            low_offset, low_slope = _line(low_row, rows, limits)
            high_offset, high_slope = _line(high_row, rows, limits)
        if low_row < 0 or -x / step > low:
            low, low_offset, low_slope = -x / step, 0.0, -1.0 / step
        if high_row < 0 or (next_max_square - x) / step < high:
            high, high_offset, high_slope = (next_max_square - x) / step, next_max_square / step, -1.0 / step
        if high - low >= -1e-12 * (abs(high) + abs(low)):
            return x
        slope = high_slope - low_slope
        root = (low_offset - high_offset) / slope if slope < 0.0 else 0.0
        if root >= x:
            return x * (1.0 - 1e-9)
        x = max(root, 0.0)
    return x


@njit(cache=True, nogil=True)
def _constrain(rows: Array, tangent: Array, end_tangent: Array, curvature: Array, step: float) -> None:
    """Writes the acceleration constraints at both ends of an interval; x at the end is x + step u."""
    joints = len(tangent)
    for j in range(joints):
        rows[j, 0], rows[j, 1] = tangent[j], curvature[j]
        rows[joints + j, 0], rows[joints + j, 1] = end_tangent[j] + step * curvature[j], curvature[j]


@njit(cache=True, nogil=True)
def optimal_speeds(
    steps: Array, tangents: Array, end_tangents: Array, curvatures: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Returns the path speeds at the n + 1 ends of the intervals and the path accelerations of the n intervals.

    Args:
        steps: Lengths of the intervals, above 0, shape (n,).
        tangents: q' at the start of each interval, shape (n, joints).
        end_tangents: q' at the end of each interval, shape (n, joints).
        curvatures: q'' in each interval, shape (n, joints).
        velocity: Joint velocity limits, above 0, shape (joints,).
        acceleration: Joint acceleration limits, above 0, shape (joints,).
    """
    count, joints = tangents.shape
    limits = np.concatenate((acceleration, acceleration))
    rows = np.empty((2 * joints, 2))
    max_squares = np.zeros(count + 1)
    for i in range(count - 1, -1, -1):
        ceiling = np.inf
        for j in range(joints):
            max_tangent = max(abs(tangents[i, j]), abs(end_tangents[i - 1, j]) if i > 0 else 0.0)
            if max_tangent > 1e-9:
                ceiling = min(ceiling, (velocity[j] / max_tangent) ** 2)
        _constrain(rows, tangents[i], end_tangents[i], curvatures[i], 2.0 * steps[i])
        max_squares[i] = _fastest_start(ceiling, 2.0 * steps[i], max_squares[i + 1], rows, limits)
    squares, path_accelerations = np.zeros(count + 1), np.zeros(count)
    for i in range(count):
        step = 2.0 * steps[i]
        _constrain(rows, tangents[i], end_tangents[i], curvatures[i], step)
        high = _bounds(squares[i], rows, limits)[1]
        path_accelerations[i] = max(min(high, (max_squares[i + 1] - squares[i]) / step), -squares[i] / step)
        squares[i + 1] = max(squares[i] + step * path_accelerations[i], 0.0)
    return np.sqrt(squares), path_accelerations


@njit(cache=True, nogil=True)
def _trapezoid(length: float, max_speed: float, path_acceleration: float) -> tuple[Array, Array, Array]:
    """Returns grid, path speeds and path accelerations of a trapezoidal profile along a straight line."""
    ramp = min(max_speed * max_speed / (2.0 * path_acceleration), 0.5 * length)
    speed = np.sqrt(2.0 * path_acceleration * ramp)
    if length - 2.0 * ramp <= 1e-9 * length:
        return (
            np.array([0.0, 0.5 * length, length]),
            np.array([0.0, speed, 0.0]),
            np.array([path_acceleration, -path_acceleration]),
        )
    return (
        np.array([0.0, ramp, length - ramp, length]),
        np.array([0.0, speed, speed, 0.0]),
        np.array([path_acceleration, 0.0, -path_acceleration]),
    )


@njit(cache=True, nogil=True)
def _grid(breaks: Array, max_length: float, min_count: int) -> tuple[Array, NDArray[np.int64]]:
    """Returns the path positions at the ends of the intervals, and the piece of each interval."""
    pieces = len(breaks) - 1
    counts = np.empty(pieces, dtype=np.int64)
    for piece in range(pieces):
        counts[piece] = max(min_count, int((breaks[piece + 1] - breaks[piece]) / max_length))
    grid, piece_indices = np.empty(counts.sum() + 1), np.empty(counts.sum(), dtype=np.int64)
    index = 0
    for piece in range(pieces):
        for k in range(counts[piece]):
            grid[index] = breaks[piece] + (breaks[piece + 1] - breaks[piece]) * k / counts[piece]
            piece_indices[index] = piece
            index += 1
    grid[index] = breaks[pieces]
    return grid, piece_indices


@njit(cache=True, nogil=True)
def _tangents(pieces: PathPieces, positions: Array, piece_indices: NDArray[np.int64]) -> Array:
    """Returns the tangents q' at path positions on the given pieces, shape (k, joints)."""
    result = np.empty((len(piece_indices), pieces.points.shape[1]))
    for i in range(len(piece_indices)):
        piece = piece_indices[i]
        result[i] = pieces.tangents[piece] + (positions[i] - pieces.breaks[piece]) * pieces.curvatures[piece]
    return result


@njit(cache=True, nogil=True)
def fastest_motion(
    pieces: PathPieces, velocity: Array, acceleration: Array, max_length: float, min_count: int
) -> PathMotion:
    """Returns the time-optimal motion along a path.

    Args:
        pieces: Parabolas of the path.
        velocity: Joint velocity limits, above 0, shape (joints,).
        acceleration: Joint acceleration limits, above 0, shape (joints,).
        max_length: Maximum length of an interval [rad or m].
        min_count: Minimum number of intervals per piece.
    """
    joints = pieces.points.shape[1]
    if len(pieces.breaks) == 2:
        tangent = np.maximum(np.abs(pieces.tangents[0]), 1e-12)
        grid, speeds, path_accelerations = _trapezoid(
            pieces.breaks[1], (velocity / tangent).min(), (acceleration / tangent).min()
        )
        piece_indices = np.zeros(len(path_accelerations), dtype=np.int64)
        starts, ends = _tangents(pieces, grid[:-1], piece_indices), _tangents(pieces, grid[1:], piece_indices)
        curvatures = pieces.curvatures[piece_indices]
    else:
        grid, piece_indices = _grid(pieces.breaks, max_length, min_count)
        starts, ends = _tangents(pieces, grid[:-1], piece_indices), _tangents(pieces, grid[1:], piece_indices)
        curvatures = pieces.curvatures[piece_indices]
        speeds, path_accelerations = optimal_speeds(np.diff(grid), starts, ends, curvatures, velocity, acceleration)
    count = len(path_accelerations)
    times, areas, jumps = np.zeros(count + 1), np.zeros((count + 1, joints)), np.zeros(count + 1)
    motion = PathMotion(grid, speeds, times, path_accelerations, piece_indices, areas, jumps)
    for i in range(count):
        duration = 2.0 * (grid[i + 1] - grid[i]) / (speeds[i] + speeds[i + 1])
        times[i + 1] = times[i] + duration
        for j in range(joints):
            areas[i + 1, j] = areas[i, j] + _area(pieces, motion, i, duration, j)
            if i > 0:
                squared_speed = speeds[i] * speeds[i]
                before = ends[i - 1, j] * path_accelerations[i - 1] + curvatures[i - 1, j] * squared_speed
                after = starts[i, j] * path_accelerations[i] + curvatures[i, j] * squared_speed
                jumps[i] = max(jumps[i], abs(after - before) / acceleration[j])
    return motion


@njit(cache=True, nogil=True)
def _point(pieces: PathPieces, motion: PathMotion, interval: int, offset: float, joint: int) -> tuple[float, float]:
    """Returns the position and velocity of a joint `offset` seconds after the start of an interval."""
    piece, path_acceleration = motion.piece_indices[interval], motion.path_accelerations[interval]
    speed = motion.speeds[interval] + offset * path_acceleration
    along = (motion.grid[interval] - pieces.breaks[piece]) + offset * (speed - 0.5 * offset * path_acceleration)
    tangent, curvature = pieces.tangents[piece, joint], pieces.curvatures[piece, joint]
    position = pieces.points[piece, joint] + along * (tangent + 0.5 * along * curvature)
    return position, (tangent + along * curvature) * speed


@njit(cache=True, nogil=True)
def _area(pieces: PathPieces, motion: PathMotion, interval: int, offset: float, joint: int) -> float:
    """Returns the exact integral of a joint position (degree 4 in time) over the first `offset` seconds."""
    half = 0.5 * offset
    first = _point(pieces, motion, interval, half * (1.0 - _NODE), joint)[0]
    middle = _point(pieces, motion, interval, half, joint)[0]
    last = _point(pieces, motion, interval, half * (1.0 + _NODE), joint)[0]
    return offset / 18.0 * (5.0 * first + 8.0 * middle + 5.0 * last)


@njit(cache=True, nogil=True)
def moving_average(pieces: PathPieces, motion: PathMotion, times: Array, window: float) -> tuple[Array, Array, Array]:
    """Returns joint positions, velocities and accelerations, averaged over the window before each time.

    With A the integral of the positions, the averaged position is (A(t) - A(t - window)) / window.

    Args:
        pieces: Parabolas of the path.
        motion: Motion along the path; the joints are at rest before and after the motion.
        times: Increasing times, shape (m,) [s].
        window: Length of the averaging window [s].
    """
    joints = pieces.points.shape[1]
    result = np.zeros((3, len(times), joints))
    count, end = len(motion.path_accelerations), motion.times[-1]
    for delay, sign in ((0.0, 1.0), (window, -1.0)):
        interval = 0
        for k in range(len(times)):
            time = times[k] - delay
            clipped_time = min(max(time, 0.0), end)
            while interval < count - 1 and clipped_time >= motion.times[interval + 1]:
                interval += 1
            offset = clipped_time - motion.times[interval]
            for j in range(joints):
                position, velocity = _point(pieces, motion, interval, offset, j)
                area = motion.areas[interval, j] + _area(pieces, motion, interval, offset, j)
                result[0, k, j] += sign * (area + (time - clipped_time) * position)
                result[1, k, j] += sign * position
                if 0.0 < time < end:
                    result[2, k, j] += sign * velocity
    result /= window
    return result[0], result[1], result[2]


@njit(cache=True, nogil=True)
def _bound_of_cubic(a: float, b: float, c: float, d: float) -> float:
    """Returns a bound of |a + b t + c t^2 + d t^3| for 0 <= t <= 1: the maximum Bernstein coefficient."""
    return max(abs(a), abs(a + b / 3.0), abs(a + 2.0 * b / 3.0 + c / 3.0), abs(a + b + c + d))


@njit(cache=True, nogil=True)
def _bound_of_quartic(a: float, b: float, c: float, d: float, e: float) -> float:
    """Returns a bound of |a + b t + c t^2 + d t^3 + e t^4| for 0 <= t <= 1: the maximum Bernstein coefficient."""
    inner = max(abs(a + b / 4.0), abs(a + b / 2.0 + c / 6.0), abs(a + 3.0 * b / 4.0 + c / 2.0 + d / 4.0))
    return max(abs(a), inner, abs(a + b + c + d + e))


@njit(cache=True, nogil=True)
def max_limit_fractions(
    times: Array, coefficients: Array, velocity: Array, acceleration: Array, samples: int
) -> tuple[float, float]:
    """Returns the maximum velocity and acceleration at samples of a curve of quintics, as fractions of the limits.

    Args:
        times: Times of the points, shape (n,) [s].
        coefficients: Polynomial coefficients, lowest power first, shape (n - 1, 6, joints).
        velocity: Joint velocity limits, shape (joints,).
        acceleration: Joint acceleration limits, shape (joints,).
        samples: Number of sample intervals per segment.
    """
    velocity_fraction, acceleration_fraction = 0.0, 0.0
    for i in range(len(times) - 1):
        span = times[i + 1] - times[i]
        step = span / samples
        for j in range(len(velocity)):
            c1, c2, c3 = coefficients[i, 1, j], coefficients[i, 2, j], coefficients[i, 3, j]
            c4, c5 = coefficients[i, 4, j], coefficients[i, 5, j]
            t2, t3, t4, t5 = 2.0 * c2 * span, 3.0 * c3 * span**2, 4.0 * c4 * span**3, 5.0 * c5 * span**4
            max_acceleration = _bound_of_cubic(t2, 2.0 * t3, 3.0 * t4, 4.0 * t5) / span
            is_slower = _bound_of_quartic(c1, t2, t3, t4, t5) <= velocity_fraction * velocity[j]
            if is_slower and max_acceleration <= acceleration_fraction * acceleration[j]:
                continue  # no sample of this segment can exceed the maximum so far
            for k in range(samples + 1):
                t = k * step
                first_derivative = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
                second_derivative = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
                velocity_fraction = max(velocity_fraction, abs(first_derivative) / velocity[j])
                acceleration_fraction = max(acceleration_fraction, abs(second_derivative) / acceleration[j])
    return velocity_fraction, acceleration_fraction


@njit(cache=True, nogil=True)
def blended_pieces(vertices: Array, blends: Array) -> PathPieces:
    """Returns the straight pieces and the parabolic blends of a polyline.

    The blend size d is the distance from the vertex at which the parabola leaves the line. Over the length 2 d of the
    blend, the tangent changes linearly from the unit direction u before the vertex to the unit direction v after the
    vertex. The parabola passes the vertex at a distance of d |u - v| / 4.

    Args:
        vertices: Polyline, shape (n, joints), n > 1.
        blends: Blend size d at each inner vertex, above 0, shape (n - 2,).
    """
    edges, joints = len(vertices) - 1, vertices.shape[1]
    breaks, filled, position = np.zeros(2 * edges), 0, 0.0
    points, tangents = np.empty((2 * edges - 1, joints)), np.empty((2 * edges - 1, joints))
    curvatures = np.zeros((2 * edges - 1, joints))
    lengths, directions = np.empty(edges), np.empty((edges, joints))
    for edge in range(edges):
        directions[edge] = vertices[edge + 1] - vertices[edge]
        lengths[edge] = np.sqrt((directions[edge] * directions[edge]).sum())
        directions[edge] /= lengths[edge]
    for edge in range(edges):
        before = blends[edge - 1] if edge > 0 else 0.0
        after = blends[edge] if edge + 1 < edges else 0.0
        straight = lengths[edge] - before - after
        if straight > 1e-12:
            points[filled] = vertices[edge] + before * directions[edge]
            tangents[filled] = directions[edge]
            position += straight
            filled += 1
            breaks[filled] = position
        if edge + 1 < edges:
            points[filled] = vertices[edge + 1] - after * directions[edge]
            tangents[filled] = directions[edge]
            curvatures[filled] = (directions[edge + 1] - directions[edge]) / (2.0 * after)
            position += 2.0 * after
            filled += 1
            breaks[filled] = position
    return PathPieces(breaks[: filled + 1], points[:filled], tangents[:filled], curvatures[:filled])


@njit(cache=True, nogil=True)
def spread_times(requested: Array, end: float, max_period: float, min_gap: float) -> Array:
    """Returns times from 0 to `end`: requested times, unless too close to another, and uniform times in between.

    Args:
        requested: Requested times in any order, shape (m,) [s].
        end: Last time [s].
        max_period: Maximum time between two points [s].
        min_gap: Minimum time between two requested times [s].
    """
    fixed_times, filled = np.zeros(len(requested) + 2), 1
    for time in np.sort(requested):
        if fixed_times[filled - 1] + min_gap <= time <= end - min_gap:
            fixed_times[filled] = time
            filled += 1
    fixed_times[filled] = end
    count = 1
    for i in range(filled):
        count += int(np.ceil((fixed_times[i + 1] - fixed_times[i]) / max_period))
    result, row = np.empty(count), 0
    for i in range(filled):
        span = fixed_times[i + 1] - fixed_times[i]
        parts = int(np.ceil(span / max_period))
        for k in range(parts):
            result[row] = fixed_times[i] + k * (span / parts)
            row += 1
    result[row] = end
    return result


@njit(cache=True, nogil=True)
def timed_points(
    vertices: Array,
    blends: Array,
    velocity: Array,
    acceleration: Array,
    window: float,
    max_period: float,
    min_gap: float,
) -> tuple[Array, Array]:
    """Returns trajectory points along a polyline with blends, from rest to rest; their quintics satisfy the limits.

    Args:
        vertices: Polyline, shape (n, joints), n > 1.
        blends: Blend sizes at the inner vertices, above 0, shape (n - 2,).
        velocity: Joint velocity limits, above 0, shape (joints,).
        acceleration: Joint acceleration limits, above 0, shape (joints,).
        window: Length of the averaging window [s].
        max_period: Maximum time between two points [s].
        min_gap: Minimum time between the points at acceleration jumps [s].

    Returns:
        Times in whole nanoseconds, shape (m,), and positions, velocities and accelerations, shape (3, m, joints).
    """
    pieces = blended_pieces(vertices, blends)
    motion = fastest_motion(pieces, velocity, acceleration, GRID_STEP, MIN_INTERVALS)
    jumps = motion.times[motion.jumps > MIN_JUMP]
    end = motion.times[-1] + window
    requested = np.concatenate((jumps, jumps + window, np.array([window, end - window])))
    times = spread_times(requested, end, max_period, min_gap)
    positions, velocities, accelerations = moving_average(pieces, motion, times, window)
    positions[0], positions[-1] = vertices[0], vertices[-1]
    velocities[0], velocities[-1] = 0.0, 0.0
    accelerations[0], accelerations[-1] = 0.0, 0.0
    coefficients = quintic_coefficients(times, positions, velocities, accelerations)
    velocity_fraction, acceleration_fraction = max_limit_fractions(
        times, coefficients, velocity, acceleration, SAMPLES_PER_SEGMENT
    )
    factor = max(1.0, velocity_fraction, np.sqrt(acceleration_fraction))
    slowed_times = np.rint(times * factor * 1e9) / 1e9
    values = curve_values(times, coefficients, slowed_times / factor, 3)
    values[0, 0], values[0, -1] = vertices[0], vertices[-1]
    values[1, 0], values[1, -1] = 0.0, 0.0
    values[2, 0], values[2, -1] = 0.0, 0.0
    values[1] /= factor
    values[2] /= factor * factor
    return slowed_times, values


@njit(cache=True, nogil=True)
def max_blends(vertices: Array, deviation: float) -> Array:
    """Returns the maximum blend size at each inner vertex, shape (n - 2,); 0 for a stop.

    Args:
        vertices: Polyline, shape (n, joints).
        deviation: Maximum distance between a vertex and its blend [rad or m].
    """
    result = np.zeros(max(0, len(vertices) - 2))
    for index in range(len(result)):
        before, after = vertices[index + 1] - vertices[index], vertices[index + 2] - vertices[index + 1]
        length, next_length = np.sqrt((before * before).sum()), np.sqrt((after * after).sum())
        before, after = before / length, after / next_length
        if (before * after).sum() < MIN_BLEND_COSINE:
            continue
        direction_change = max(np.sqrt(((after - before) ** 2).sum()), 1e-9)
        size = min(MAX_BLEND_FRACTION * length, MAX_BLEND_FRACTION * next_length, 4.0 * deviation / direction_change)
        if size >= MIN_BLEND:
            result[index] = size
    return result


@njit(cache=True, nogil=True)
def blend_samples(start: Array, waypoint: Array, end: Array, size: float, step: float) -> Array:
    """Returns samples of the parabola of a blend, see `blended_pieces`; shape (m, joints).

    Args:
        start: Vertex before the blended waypoint, shape (joints,).
        waypoint: Blended waypoint, shape (joints,).
        end: Vertex after the blended waypoint, shape (joints,).
        size: Blend size [rad or m].
        step: Distance between samples [rad or m].
    """
    before, after = waypoint - start, end - waypoint
    before /= np.sqrt((before * before).sum())
    after /= np.sqrt((after * after).sum())
    count = max(8, int(2.0 * size / step))
    result = np.empty((count, len(waypoint)))
    for k in range(count):
        distance = 2.0 * size * k / (count - 1)
        result[k] = waypoint - size * before + distance * before + distance * distance * (after - before) / (4.0 * size)
    return result
