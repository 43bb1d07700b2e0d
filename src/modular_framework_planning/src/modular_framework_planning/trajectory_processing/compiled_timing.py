# SPDX-License-Identifier: BSD-3-Clause
"""Compiled numerics of timing: the fastest motion along a path of parabolas (TOPP-RA), its average over a window.

The path is cut into intervals on which the tangent q' is linear and the curvature q'' constant in path position s, and
the path acceleration u is taken constant. The joint acceleration q' u + q'' x, with x the squared path speed, is then
linear over the interval, so that bounding it at both ends bounds it everywhere.

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

_FLAT = 1.0e-10  # a joint whose tangent is smaller than this does not bound the path acceleration
_NODE = 0.7745966692414834  # outer node of Gauss's quadrature with three nodes, exact for polynomials of degree 5
GRID_STEP = 0.02  # [rad or m] between changes of the path acceleration, at most
MIN_INTERVALS = 12  # a straight or curved piece is cut into
JUMP = 0.05  # jump of an acceleration, as a share of its limit, that is worth a point
SAMPLES_PER_SEGMENT = 24
NEARLY_REVERSED = -0.9  # cosine of the turn below which the motion stops instead of swinging round
SMALLEST_BLEND = 1.0e-3  # [rad or m]


class PathPieces(NamedTuple):
    """A path of m parabolas: ends by path position, shape (m + 1,); starts, tangents there, curvatures: (m, joints)."""

    breaks: Array
    points: Array
    tangents: Array
    curvatures: Array


class PathMotion(NamedTuple):
    """Motion along a path from rest to rest in n intervals of constant path acceleration.

    Attributes:
        grid, speeds, times: path position, path speed and time at the ends of the intervals, shape (n + 1,).
        rates: path accelerations, shape (n,); numbers: piece of the path each interval lies in.
        areas: integrals of the joint positions from the start to the ends of the intervals, shape (n + 1, joints).
        jumps: largest jump of a joint's acceleration at the inner ends as a share of its limit, shape (n + 1,).
    """

    grid: Array
    speeds: Array
    times: Array
    rates: Array
    numbers: NDArray[np.int64]
    areas: Array
    jumps: Array


@njit(cache=True, nogil=True)
def _bounds(squared_speed: float, rows: Array, limits: Array) -> tuple[float, float, int, int]:
    """Returns lowest and highest path acceleration at a squared speed, and the rows that set them (-1: none).

    Row (a, b) of `rows` with limit c states -c <= a u + b x <= c; its upper half is row k, its lower half row k + n.
    """
    lowest, highest, low_row, high_row = -np.inf, np.inf, -1, -1
    count = len(limits)
    for k in range(count):
        a = rows[k, 0]
        if abs(a) < _FLAT:
            continue
        one = (limits[k] - rows[k, 1] * squared_speed) / a
        other = (-limits[k] - rows[k, 1] * squared_speed) / a
        one_row, other_row = k, k + count
        if one > other:
            one, other, one_row, other_row = other, one, other_row, one_row
        if one > lowest:
            lowest, low_row = one, one_row
        if other < highest:
            highest, high_row = other, other_row
    return lowest, highest, low_row, high_row


@njit(cache=True, nogil=True)
def _line(row: int, rows: Array, limits: Array) -> tuple[float, float]:
    """Returns offset and slope over x of the bound on u that a row sets."""
    count = len(limits)
    k = row % count
    limit = limits[k] if row < count else -limits[k]
    return limit / rows[k, 0], -rows[k, 1] / rows[k, 0]


@njit(cache=True, nogil=True)
def _fastest_start(ceiling: float, step: float, next_highest: float, rows: Array, limits: Array) -> float:
    """Largest squared speed at the start of an interval from which its end can be reached at an allowed speed.

    The width of the allowed range of u is concave in x and not negative at 0: Newton's method from the right ends at
    its root after as many steps as there are pairs of active rows, at most. `step` is twice the interval's length.
    """
    x = ceiling
    for k in range(len(limits)):
        if abs(rows[k, 0]) < _FLAT and abs(rows[k, 1]) > _FLAT:
            x = min(x, limits[k] / abs(rows[k, 1]))
    for _ in range(50):
        low, high, low_row, high_row = _bounds(x, rows, limits)
        low_offset, low_slope, high_offset, high_slope = 0.0, 0.0, 0.0, 0.0
        if low_row >= 0:
            low_offset, low_slope = _line(low_row, rows, limits)
            high_offset, high_slope = _line(high_row, rows, limits)
        if low_row < 0 or -x / step > low:
            low, low_offset, low_slope = -x / step, 0.0, -1.0 / step
        if high_row < 0 or (next_highest - x) / step < high:
            high, high_offset, high_slope = (next_highest - x) / step, next_highest / step, -1.0 / step
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
    """Writes the acceleration constraints at both ends of an interval; x at its end is x + step u."""
    joints = len(tangent)
    for j in range(joints):
        rows[j, 0], rows[j, 1] = tangent[j], curvature[j]
        rows[joints + j, 0], rows[joints + j, 1] = end_tangent[j] + step * curvature[j], curvature[j]


@njit(cache=True, nogil=True)
def optimal_speeds(
    steps: Array, tangents: Array, end_tangents: Array, curvatures: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Returns path speeds at the n + 1 ends of the intervals and path accelerations in the n intervals.

    Args:
        steps: lengths of the intervals, above 0, shape (n,).
        tangents: q' at the start of each interval, shape (n, joints).
        end_tangents: q' at the end of each interval, shape (n, joints).
        curvatures: q'' on each interval, shape (n, joints).
        velocity: limits of the joints, above 0, shape (joints,).
        acceleration: limits of the joints, above 0, shape (joints,).
    """
    count, joints = tangents.shape
    limits = np.concatenate((acceleration, acceleration))
    rows = np.empty((2 * joints, 2))
    highest = np.zeros(count + 1)
    ceiling = np.inf
    for i in range(count - 1, -1, -1):
        ceiling = np.inf
        for j in range(joints):
            steepest = max(abs(tangents[i, j]), abs(end_tangents[i - 1, j]) if i > 0 else 0.0)
            if steepest > 1e-9:
                ceiling = min(ceiling, (velocity[j] / steepest) ** 2)
        _constrain(rows, tangents[i], end_tangents[i], curvatures[i], 2.0 * steps[i])
        highest[i] = _fastest_start(ceiling, 2.0 * steps[i], highest[i + 1], rows, limits)
    squares, rates = np.zeros(count + 1), np.zeros(count)
    for i in range(count):
        step = 2.0 * steps[i]
        _constrain(rows, tangents[i], end_tangents[i], curvatures[i], step)
        high = _bounds(squares[i], rows, limits)[1]
        rates[i] = max(min(high, (highest[i + 1] - squares[i]) / step), -squares[i] / step)
        squares[i + 1] = max(squares[i] + step * rates[i], 0.0)
    return np.sqrt(squares), rates


@njit(cache=True, nogil=True)
def _trapezoid(length: float, top: float, rate: float) -> tuple[Array, Array, Array]:
    """Grid, path speeds and path accelerations along a straight line with a top speed and an acceleration."""
    ramp = min(top * top / (2.0 * rate), 0.5 * length)
    speed = np.sqrt(2.0 * rate * ramp)
    if length - 2.0 * ramp <= 1e-9 * length:
        return np.array([0.0, 0.5 * length, length]), np.array([0.0, speed, 0.0]), np.array([rate, -rate])
    return (
        np.array([0.0, ramp, length - ramp, length]),
        np.array([0.0, speed, speed, 0.0]),
        np.array([rate, 0.0, -rate]),
    )


@njit(cache=True, nogil=True)
def _grid(breaks: Array, longest: float, fewest: int) -> tuple[Array, NDArray[np.int64]]:
    """Ends of the intervals and the piece of each interval."""
    pieces = len(breaks) - 1
    counts = np.empty(pieces, dtype=np.int64)
    for piece in range(pieces):
        counts[piece] = max(fewest, int((breaks[piece + 1] - breaks[piece]) / longest))
    grid, numbers = np.empty(counts.sum() + 1), np.empty(counts.sum(), dtype=np.int64)
    index = 0
    for piece in range(pieces):
        for k in range(counts[piece]):
            grid[index] = breaks[piece] + (breaks[piece + 1] - breaks[piece]) * k / counts[piece]
            numbers[index] = piece
            index += 1
    grid[index] = breaks[pieces]
    return grid, numbers


@njit(cache=True, nogil=True)
def _tangents(pieces: PathPieces, positions: Array, numbers: NDArray[np.int64]) -> Array:
    result = np.empty((len(numbers), pieces.points.shape[1]))
    for i in range(len(numbers)):
        piece = numbers[i]
        result[i] = pieces.tangents[piece] + (positions[i] - pieces.breaks[piece]) * pieces.curvatures[piece]
    return result


@njit(cache=True, nogil=True)
def fastest_motion(pieces: PathPieces, velocity: Array, acceleration: Array, longest: float, fewest: int) -> PathMotion:
    """Returns the fastest motion; intervals are at most `longest` long, and at least `fewest` a piece."""
    joints = pieces.points.shape[1]
    if len(pieces.breaks) == 2:
        tangent = np.maximum(np.abs(pieces.tangents[0]), 1e-12)
        grid, speeds, rates = _trapezoid(pieces.breaks[1], (velocity / tangent).min(), (acceleration / tangent).min())
        numbers = np.zeros(len(rates), dtype=np.int64)
        starts, ends = _tangents(pieces, grid[:-1], numbers), _tangents(pieces, grid[1:], numbers)
    else:
        grid, numbers = _grid(pieces.breaks, longest, fewest)
        starts, ends = _tangents(pieces, grid[:-1], numbers), _tangents(pieces, grid[1:], numbers)
        speeds, rates = optimal_speeds(np.diff(grid), starts, ends, pieces.curvatures[numbers], velocity, acceleration)
    count = len(rates)
    times, areas, jumps = np.zeros(count + 1), np.zeros((count + 1, joints)), np.zeros(count + 1)
    motion = PathMotion(grid, speeds, times, rates, numbers, areas, jumps)
    for i in range(count):
        duration = 2.0 * (grid[i + 1] - grid[i]) / (speeds[i] + speeds[i + 1])
        times[i + 1] = times[i] + duration
        for j in range(joints):
            areas[i + 1, j] = areas[i, j] + _area(pieces, motion, i, duration, j)
            if i > 0:
                square = speeds[i] * speeds[i]
                before = ends[i - 1, j] * rates[i - 1] + pieces.curvatures[numbers[i - 1], j] * square
                after = starts[i, j] * rates[i] + pieces.curvatures[numbers[i], j] * square
                jumps[i] = max(jumps[i], abs(after - before) / acceleration[j])
    return motion


@njit(cache=True, nogil=True)
def _point(pieces: PathPieces, motion: PathMotion, interval: int, offset: float, joint: int) -> tuple[float, float]:
    """Position and velocity of a joint `offset` seconds after the start of an interval."""
    piece, rate = motion.numbers[interval], motion.rates[interval]
    speed = motion.speeds[interval] + offset * rate
    along = (motion.grid[interval] - pieces.breaks[piece]) + offset * (speed - 0.5 * offset * rate)
    tangent, curvature = pieces.tangents[piece, joint], pieces.curvatures[piece, joint]
    return (
        pieces.points[piece, joint] + along * (tangent + 0.5 * along * curvature),
        (tangent + along * curvature) * speed,
    )


@njit(cache=True, nogil=True)
def _area(pieces: PathPieces, motion: PathMotion, interval: int, offset: float, joint: int) -> float:
    """Integral of a joint's position over the first `offset` seconds of an interval."""
    half = 0.5 * offset
    return (
        offset
        / 18.0
        * (
            5.0 * _point(pieces, motion, interval, half * (1.0 - _NODE), joint)[0]
            + 8.0 * _point(pieces, motion, interval, half, joint)[0]
            + 5.0 * _point(pieces, motion, interval, half * (1.0 + _NODE), joint)[0]
        )
    )


@njit(cache=True, nogil=True)
def averaged(pieces: PathPieces, motion: PathMotion, times: Array, window: float) -> tuple[Array, Array, Array]:
    """Returns positions, velocities and accelerations of the motion averaged over the window before each time.

    The motion rests before and after. Args: increasing times of shape (m,) [s], window [s].
    """
    joints = pieces.points.shape[1]
    result = np.zeros((3, len(times), joints))
    count, end = len(motion.rates), motion.times[-1]
    for side, sign in ((0.0, 1.0), (window, -1.0)):
        interval = 0
        for k in range(len(times)):
            time = times[k] - side
            inner = min(max(time, 0.0), end)
            while interval < count - 1 and inner >= motion.times[interval + 1]:
                interval += 1
            offset = inner - motion.times[interval]
            for j in range(joints):
                position, velocity = _point(pieces, motion, interval, offset, j)
                area = motion.areas[interval, j] + _area(pieces, motion, interval, offset, j)
                result[0, k, j] += sign * (area + (time - inner) * position)
                result[1, k, j] += sign * position
                if 0.0 < time < end:
                    result[2, k, j] += sign * velocity
    result /= window
    return result[0], result[1], result[2]


@njit(cache=True, nogil=True)
def _bound_of_cubic(a: float, b: float, c: float, d: float) -> float:
    """Bound of |a + b t + c t^2 + d t^3| over 0 <= t <= 1: the largest of its Bernstein coefficients."""
    return max(abs(a), abs(a + b / 3.0), abs(a + 2.0 * b / 3.0 + c / 3.0), abs(a + b + c + d))


@njit(cache=True, nogil=True)
def _bound_of_quartic(a: float, b: float, c: float, d: float, e: float) -> float:
    """Bound of |a + b t + c t^2 + d t^3 + e t^4| over 0 <= t <= 1: the largest of its Bernstein coefficients."""
    inner = max(abs(a + b / 4.0), abs(a + b / 2.0 + c / 6.0), abs(a + 3.0 * b / 4.0 + c / 2.0 + d / 4.0))
    return max(abs(a), inner, abs(a + b + c + d + e))


@njit(cache=True, nogil=True)
def largest_shares(
    times: Array, coefficients: Array, velocity: Array, acceleration: Array, samples: int
) -> tuple[float, float]:
    """Returns the largest share of the velocity and of the acceleration limits along a curve of quintics.

    Args: times of the points, shape (n,); coefficients, lowest power first, shape (n - 1, 6, joints); limits of shape
        (joints,); samples looked at in each segment.
    """
    fastest, hardest = 0.0, 0.0
    for i in range(len(times) - 1):
        span = times[i + 1] - times[i]
        step = span / samples
        for j in range(len(velocity)):
            c1, c2, c3 = coefficients[i, 1, j], coefficients[i, 2, j], coefficients[i, 3, j]
            c4, c5 = coefficients[i, 4, j], coefficients[i, 5, j]
            t2, t3, t4, t5 = 2.0 * c2 * span, 3.0 * c3 * span**2, 4.0 * c4 * span**3, 5.0 * c5 * span**4
            speeds = _bound_of_quartic(c1, t2, t3, t4, t5)
            rates = _bound_of_cubic(t2, 2.0 * t3, 3.0 * t4, 4.0 * t5) / span
            if speeds <= fastest * velocity[j] and rates <= hardest * acceleration[j]:
                continue  # no sample can be above those seen
            for k in range(samples + 1):
                t = k * step
                speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
                rate = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
                fastest = max(fastest, abs(speed) / velocity[j])
                hardest = max(hardest, abs(rate) / acceleration[j])
    return fastest, hardest


@njit(cache=True, nogil=True)
def blended_pieces(vertices: Array, blends: Array) -> PathPieces:
    """Returns the straight pieces and the parabolic corners of a polyline.

    With d the distance from a corner at which the parabola leaves the line, u and v the unit directions before and
    after it, the derivative along the parabola goes linearly from u to v over a length 2 d. It misses the corner by
    d |u - v| / 4.

    Args: vertices of shape (n, joints), n > 1; distance d of each inner corner, shape (n - 2,), above 0.
    """
    edges, joints = len(vertices) - 1, vertices.shape[1]
    breaks, used, position = np.zeros(2 * edges), 0, 0.0
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
            points[used] = vertices[edge] + before * directions[edge]
            tangents[used] = directions[edge]
            position += straight
            used += 1
            breaks[used] = position
        if edge + 1 < edges:
            points[used] = vertices[edge + 1] - after * directions[edge]
            tangents[used] = directions[edge]
            curvatures[used] = (directions[edge + 1] - directions[edge]) / (2.0 * after)
            position += 2.0 * after
            used += 1
            breaks[used] = position
    return PathPieces(breaks[: used + 1], points[:used], tangents[:used], curvatures[:used])


@njit(cache=True, nogil=True)
def spread_times(wanted: Array, end: float, longest: float, shortest: float) -> Array:
    """Returns times from 0 to `end`: the wanted ones, where not too near to each other, and evenly between.

    Args: wanted times of shape (m,), in any order; last time; longest and shortest time between two [s].
    """
    kept, used = np.zeros(len(wanted) + 2), 1
    for time in np.sort(wanted):
        if kept[used - 1] + shortest <= time <= end - shortest:
            kept[used] = time
            used += 1
    kept[used] = end
    count = 1
    for i in range(used):
        count += int(np.ceil((kept[i + 1] - kept[i]) / longest))
    result, row = np.empty(count), 0
    for i in range(used):
        span = kept[i + 1] - kept[i]
        parts = int(np.ceil(span / longest))
        for k in range(parts):
            result[row] = kept[i] + k * (span / parts)
            row += 1
    result[row] = end
    return result


@njit(cache=True, nogil=True)
def timed_points(
    vertices: Array, blends: Array, velocity: Array, acceleration: Array, window: float, longest: float, shortest: float
) -> tuple[Array, Array]:
    """Times a polyline with blended corners from rest to rest.

    Args: vertices of shape (n, joints), n > 1; distance of each inner corner, shape (n - 2,), above 0; limits of the
        joints, above 0, shape (joints,); the window over which the fastest motion is averaged; longest and shortest
        time between two points [s].

    Returns:
        Times of the points, shape (m,), whole nanoseconds; positions, velocities and accelerations (3, m, joints). The
        quintics between them keep the limits.
    """
    pieces = blended_pieces(vertices, blends)
    motion = fastest_motion(pieces, velocity, acceleration, GRID_STEP, MIN_INTERVALS)
    jumps = motion.times[motion.jumps > JUMP]
    end = motion.times[-1] + window
    wanted = np.concatenate((jumps, jumps + window, np.array([window, end - window])))
    times = spread_times(wanted, end, longest, shortest)
    positions, velocities, accelerations = averaged(pieces, motion, times, window)
    positions[0], positions[-1] = vertices[0], vertices[-1]
    velocities[0], velocities[-1] = 0.0, 0.0
    accelerations[0], accelerations[-1] = 0.0, 0.0
    coefficients = quintic_coefficients(times, positions, velocities, accelerations)
    fastest, hardest = largest_shares(times, coefficients, velocity, acceleration, SAMPLES_PER_SEGMENT)
    factor = max(1.0, fastest, np.sqrt(hardest))
    slower = np.rint(times * factor * 1e9) / 1e9
    values = curve_values(times, coefficients, slower / factor, 3)
    values[0, 0], values[0, -1] = vertices[0], vertices[-1]
    values[1, 0], values[1, -1] = 0.0, 0.0
    values[2, 0], values[2, -1] = 0.0, 0.0
    values[1] /= factor
    values[2] /= factor * factor
    return slower, values


@njit(cache=True, nogil=True)
def largest_blends(vertices: Array, deviation: float) -> Array:
    """Returns the distance from each inner corner at which its parabola may leave the line, shape (n - 2,); 0: none.

    Args: vertices of shape (n, joints); most distance of the parabola from the corner [rad or m].
    """
    result = np.zeros(max(0, len(vertices) - 2))
    for number in range(len(result)):
        before, after = vertices[number + 1] - vertices[number], vertices[number + 2] - vertices[number + 1]
        length, next_length = np.sqrt((before * before).sum()), np.sqrt((after * after).sum())
        before, after = before / length, after / next_length
        if (before * after).sum() < NEARLY_REVERSED:
            continue
        turn = max(np.sqrt(((after - before) ** 2).sum()), 1e-9)
        size = min(0.45 * length, 0.45 * next_length, 4.0 * deviation / turn)
        if size >= SMALLEST_BLEND:
            result[number] = size
    return result


@njit(cache=True, nogil=True)
def corner_samples(start: Array, corner: Array, end: Array, size: float, step: float) -> Array:
    """Returns samples of the parabola that rounds a corner, shape (m, joints).

    Args: the vertex before, the corner and the vertex behind it, shape (joints,) each; distance from the corner at
        which the parabola leaves the line; distance of the samples.
    """
    before, after = corner - start, end - corner
    before /= np.sqrt((before * before).sum())
    after /= np.sqrt((after * after).sum())
    count = max(8, int(2.0 * size / step))
    result = np.empty((count, len(corner)))
    for k in range(count):
        way = 2.0 * size * k / (count - 1)
        result[k] = corner - size * before + way * before + way * way * (after - before) / (4.0 * size)
    return result
