# SPDX-License-Identifier: BSD-3-Clause
"""Gives a path its fastest timing within velocity and acceleration limits (TOPP-RA), sampled for a controller."""
from __future__ import annotations

from typing import Any

import numpy as np

from modular_framework_planning.blended_path import BlendedPath
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.spatial import Array
from modular_framework_planning.trajectory import Trajectory

SAMPLE_PERIOD_S = 0.02
MAX_SAMPLES = 20_000
GRID_STEP = 0.05  # [rad or m] between grid points of the optimisation
BREAK_GAP = 1.0e-6  # [rad or m] grid points on both sides of a jump in curvature


class _Profile:
    """Path position over time as pieces of constant path acceleration."""

    def __init__(self, grid: Array, speeds: Array) -> None:
        spans = np.diff(grid)
        durations = 2.0 * spans / np.maximum(speeds[:-1] + speeds[1:], 1e-9)
        self.times = np.concatenate([[0.0], np.cumsum(durations)])
        self._grid, self._speeds = grid, speeds
        self._accelerations = np.diff(speeds) / np.maximum(durations, 1e-12)

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Returns path position, speed and acceleration at the given times."""
        piece = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self._accelerations) - 1)
        offset = times - self.times[piece]
        acceleration = self._accelerations[piece]
        speed = self._speeds[piece] + acceleration * offset
        position = self._grid[piece] + self._speeds[piece] * offset + 0.5 * acceleration * offset * offset
        return position, speed, acceleration


def _straight_profile(path: BlendedPath, velocity: Array, acceleration: Array) -> _Profile:
    """Trapezoid (or triangle) along one straight piece, in closed form."""
    tangent = np.maximum(np.abs(path.evaluate(np.zeros(1), 1)[0]), 1e-12)
    top, rate = float((velocity / tangent).min()), float((acceleration / tangent).min())
    ramp = min(top * top / (2.0 * rate), path.length / 2.0)
    speed = float(np.sqrt(2.0 * rate * ramp))
    if path.length - 2.0 * ramp <= 1e-9:
        return _Profile(np.array([0.0, path.length / 2.0, path.length]), np.array([0.0, speed, 0.0]))
    return _Profile(np.array([0.0, ramp, path.length - ramp, path.length]), np.array([0.0, speed, speed, 0.0]))


def _grid(path: BlendedPath) -> Array:
    pieces = []
    for low, high in zip(path.breaks[:-1], path.breaks[1:], strict=True):
        gap = min(BREAK_GAP, 0.01 * (high - low))
        inner = np.linspace(low + gap, high - gap, max(6, int((high - low) / GRID_STEP)))
        pieces.append(np.concatenate([[low], inner]))
    return np.concatenate([*pieces, [path.length]])


def _optimal_profile(path: BlendedPath, velocity: Array, acceleration: Array) -> _Profile | None:
    """Time-optimal path parameterisation by reachability analysis; None where the numerics give up."""
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    grid = _grid(path)
    limits = [JointVelocityConstraint(np.column_stack([-velocity, velocity])),
              JointAccelerationConstraint(np.column_stack([-acceleration, acceleration]))]
    solver = TOPPRA(limits, _toppra_path(path, len(velocity)), gridpoints=grid, solver_wrapper="seidel")
    _, speeds, _ = solver.compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or (speeds[1:-1] <= 0.0).any():
        return None
    return _Profile(grid, np.asarray(speeds, dtype=float))


def _toppra_path(path: BlendedPath, joints: int) -> Any:
    from toppra.interpolator import AbstractGeometricPath

    class _Adapter(AbstractGeometricPath):
        """Shows a BlendedPath to TOPP-RA."""

        def __call__(self, path_positions: Any, order: int = 0) -> Any:
            values = path.evaluate(np.atleast_1d(np.asarray(path_positions, dtype=float)), order)
            return values[0] if np.ndim(path_positions) == 0 else values

        @property
        def dof(self) -> int:
            return joints

        @property
        def path_interval(self) -> Array:
            return np.array([0.0, path.length])

    return _Adapter()


def _sample(path: BlendedPath, profile: _Profile, velocity: Array, acceleration: Array) -> tuple[Array, ...]:
    """Samples a profile at even times, slowed down by what numerics may have overrun."""
    duration = float(profile.times[-1])
    count = int(np.clip(np.ceil(duration / SAMPLE_PERIOD_S), 2, MAX_SAMPLES))
    times = np.linspace(0.0, duration, count + 1)
    position, speed, change = profile.at(times)
    tangent, curvature = path.evaluate(position, 1), path.evaluate(position, 2)
    velocities = tangent * speed[:, None]
    accelerations = tangent * change[:, None] + curvature * (speed * speed)[:, None]
    overrun = max(1.0, float((np.abs(velocities) / velocity).max()),
                  float(np.sqrt((np.abs(accelerations) / acceleration).max())))
    positions = path.evaluate(position, 0)
    velocities[0] = velocities[-1] = 0.0
    return times * overrun, positions, velocities / overrun, accelerations / overrun**2


def _sections(vertices: Array, blends: Array) -> list[BlendedPath]:
    """Cuts the polyline at the corners where the motion stops."""
    stops = [0, *(number + 1 for number, blend in enumerate(blends) if blend <= 0.0), len(vertices) - 1]
    return [BlendedPath(vertices[low:high + 1], blends[low:high - 1])
            for low, high in zip(stops[:-1], stops[1:], strict=True)]


def parameterize(joint_names: tuple[str, ...], vertices: Array, blends: Array, velocity: Array,
                 acceleration: Array) -> Trajectory:
    """Times a polyline with blended corners.

    Args:
        joint_names: columns of `vertices`.
        vertices: shape (n, joints), neighbours differ.
        blends: corner distances of shape (n - 2,); 0 stops at the corner.
        velocity, acceleration: limits of shape (joints,), scaling already applied.

    Raises:
        PlanningError: a limit is not above 0, or no timing was found.
    """
    if not (np.isfinite(velocity).all() and np.isfinite(acceleration).all() and (velocity > 0).all()
            and (acceleration > 0).all()):
        raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"velocity limits {velocity.tolist()} and acceleration "
                            f"limits {acceleration.tolist()}: all must be finite and above 0")
    if len(vertices) < 2:
        still = np.zeros_like(vertices)
        return Trajectory(joint_names, np.zeros(1), vertices.copy(), still, still.copy())
    parts: list[tuple[Array, ...]] = []
    for section in _sections(vertices, blends):
        straight = len(section.breaks) == 2
        profile = (_straight_profile if straight else _optimal_profile)(section, velocity, acceleration)
        if profile is None:
            raise PlanningError(ErrorCode.INVALID_MOTION_PLAN, "time parameterisation found no feasible timing")
        times, *rest = _sample(section, profile, velocity, acceleration)
        offset = parts[-1][0][-1] if parts else 0.0
        skip = 1 if parts else 0
        parts.append((times[skip:] + offset, *(item[skip:] for item in rest)))
    times, positions, velocities, accelerations = (np.concatenate(items) for items in zip(*parts, strict=True))
    positions[0], positions[-1] = vertices[0], vertices[-1]
    return Trajectory(joint_names, times, positions, velocities, accelerations)
