# SPDX-License-Identifier: BSD-3-Clause
"""Cartesian speed limit of a link: slows a trajectory down only where the link exceeds the limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.time_parameterization import (
    MARGIN,
    MAX_PERIOD_S,
    required_slowdown,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

SAMPLE_PERIOD_S = 0.005  # sampling period of the link speed
MAX_SAMPLES = 20_000
EASE_S = 0.1  # duration of the transition before and after a slowed section
MAX_SLOWED_PERIOD_S = 2.5 * MAX_PERIOD_S


@dataclass(frozen=True, slots=True)
class MovedFrame:
    """A frame that a trajectory moves.

    Attributes:
        model: Robot model.
        frame: A link, a held object or its subframe.
        full_positions: Returns the positions of the whole robot for a joint vector.
    """

    model: RobotModel
    frame: FrameOnRobot
    full_positions: Callable[[Array], Array]


def frame_speeds(moved: MovedFrame, trajectory: Trajectory, times: Array) -> Array:
    """Returns the speeds of a frame's origin, shape (m,) [m/s].

    Args:
        moved: Frame.
        trajectory: Trajectory of the moving joints.
        times: Sample times, shape (m,) [s].
    """
    model = moved.model
    curve = trajectory.sample(times)
    indices = [model.index[name] for name in trajectory.joint_names]
    data, frame = model.pin_model.createData(), moved.frame
    result = np.empty(len(times))
    for index, (values, rates) in enumerate(zip(curve.positions, curve.velocities, strict=True)):
        all_rates = np.zeros(len(model.joint_names))
        all_rates[indices] = rates
        for follower, leader, multiplier, _ in model.mimics:
            all_rates[follower] = multiplier * all_rates[leader]
        pin.computeJointJacobians(model.pin_model, data, moved.full_positions(values))
        jacobian = pin.getFrameJacobian(
            model.pin_model, data, frame.joint, frame.placement, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        result[index] = np.linalg.norm(jacobian[:3] @ all_rates)
    return result


def _envelope(values: Array, half_width: int) -> Array:
    """Returns a smooth upper envelope: the maximum within `half_width` samples, averaged twice over half of them."""
    padded = np.pad(values, half_width, mode="edge")
    max_speed = np.lib.stride_tricks.sliding_window_view(
        np.pad(padded, half_width, mode="edge"), 2 * half_width + 1
    ).max(axis=1)
    half = half_width // 2
    kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    return np.convolve(np.convolve(max_speed, kernel, mode="same"), kernel, mode="same")[
        half_width : half_width + len(values)
    ]


def _slowed_smoothly(trajectory: Trajectory, times: Array, slowing: Array) -> Trajectory:
    """Returns the trajectory slowed by a time-dependent factor; all arrays have shape (m,)."""
    from scipy.integrate import cumulative_trapezoid  # imported here, because the import takes 0.4 s
    from scipy.interpolate import CubicSpline

    factors = np.maximum(slowing, 1.0)
    slowed_times = cumulative_trapezoid(factors, times, initial=0.0)  # new times before the speed factor is smoothed
    samples = np.linspace(0.0, slowed_times[-1], min(int(slowed_times[-1] / SAMPLE_PERIOD_S), MAX_SAMPLES) + 20)
    half_width = max(2, int(min(EASE_S, 0.25 * slowed_times[-1]) / samples[1]))
    slowdown = CubicSpline(
        np.interp(samples, slowed_times, times), _envelope(np.interp(samples, slowed_times, factors), half_width)
    )
    new_time = slowdown.antiderivative()
    counts = np.ceil(np.diff(new_time(trajectory.times)) / MAX_SLOWED_PERIOD_S).astype(int)
    pieces = [
        np.linspace(low, high, max(1, count), endpoint=False)
        for low, high, count in zip(trajectory.times[:-1], trajectory.times[1:], counts, strict=True)
    ]
    old_times = np.append(np.concatenate(pieces), trajectory.duration_s)
    positions, velocities, accelerations, _ = trajectory.sample(old_times)
    factor, factor_rate = slowdown(old_times)[:, None], slowdown(old_times, 1)[:, None]
    return Trajectory(
        trajectory.joint_names,
        new_time(old_times),
        positions,
        velocities / factor,
        (accelerations - velocities * factor_rate / factor) / factor**2,
    )


def with_limited_link_speed(
    trajectory: Trajectory, moved: MovedFrame, max_speed: float, velocity: Array, acceleration: Array
) -> Trajectory:
    """Returns the trajectory along the same curve with a limited link speed.

    Args:
        trajectory: Trajectory of the moving joints.
        moved: Frame with limited speed.
        max_speed: Speed limit, above 0 [m/s].
        velocity: Joint velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Joint acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
    """
    if len(trajectory.times) < 2:
        return trajectory
    speed_limit = max_speed * (1.0 - MARGIN)
    times = trajectory.sample_times(min(SAMPLE_PERIOD_S, trajectory.duration_s / 20.0))
    slowing = frame_speeds(moved, trajectory, times) / speed_limit
    if slowing.max() <= 1.0:
        return trajectory
    slowed = _slowed_smoothly(trajectory, times, slowing)
    excess = float(frame_speeds(moved, slowed, slowed.sample_times()).max()) / speed_limit
    factor = max(excess, required_slowdown(slowed, velocity * (1.0 - MARGIN), acceleration * (1.0 - MARGIN)))
    return slowed.with_slowdown(max(factor, 1.0))
