# SPDX-License-Identifier: BSD-3-Clause
"""Slows a timed motion down where a link's Cartesian speed exceeds a limit; elsewhere the speed stays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.time_parameterization import LONGEST_PERIOD_S, MARGIN, overrun
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

PERIOD_S = 0.005  # of the samples of the link's speed that choose the slow-down
MOST_SAMPLES = 20_000
EASE_S = 0.1  # over which the pace changes, on both sides of a fast stretch
LONGEST_SLOWED_PERIOD_S = 2.5 * LONGEST_PERIOD_S


def link_speeds(
    model: RobotModel, trajectory: Trajectory, full_positions: Callable[[Array], Array], link: str, times: Array
) -> Array:
    """Returns speeds of a link's origin [m/s] at some times, shape (m,).

    Args:
        model: the robot.
        trajectory: motion of some joints.
        full_positions: gives positions of the whole robot for a joint vector.
        link: name of the link.
        times: [s], shape (m,).
    """
    positions, velocities, _, _ = trajectory.at(times)
    indices = [model.index[name] for name in trajectory.joint_names]
    data, frame = model.pin_model.createData(), model.frame_ids[link]
    result = np.empty(len(times))
    for number, (values, rates) in enumerate(zip(positions, velocities, strict=True)):
        all_rates = np.zeros(len(model.joint_names))
        all_rates[indices] = rates
        for follower, leader, multiplier, _ in model.mimics:
            all_rates[follower] = multiplier * all_rates[leader]
        jacobian = pin.computeFrameJacobian(
            model.pin_model, data, full_positions(values), frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        result[number] = np.linalg.norm(jacobian[:3] @ all_rates)
    return result


def _envelope(values: Array, reach: int) -> Array:
    """Smooth curve above the values: the highest within `reach` samples, averaged twice over half of them each."""
    padded = np.pad(values, reach, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(padded, reach, mode="edge"), 2 * reach + 1).max(axis=1)
    half = reach // 2
    kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    return np.convolve(np.convolve(highest, kernel, mode="same"), kernel, mode="same")[reach : reach + len(values)]


def _eased(trajectory: Trajectory, times: Array, slowing: Array) -> Trajectory:
    """Runs the trajectory slower by a factor that changes over time; all arrays of shape (m,)."""
    from scipy.integrate import cumulative_trapezoid  # 0.4 s of import, for motions that are slowed only
    from scipy.interpolate import CubicSpline

    lowest = np.maximum(slowing, 1.0)
    slowed = cumulative_trapezoid(lowest, times, initial=0.0)  # a pace that changes at once; it is eased in this time
    samples = np.linspace(0.0, slowed[-1], min(int(slowed[-1] / PERIOD_S), MOST_SAMPLES) + 20)
    reach = max(2, int(min(EASE_S, 0.25 * slowed[-1]) / samples[1]))
    pace = CubicSpline(np.interp(samples, slowed, times), _envelope(np.interp(samples, slowed, lowest), reach))
    clock = pace.antiderivative()
    counts = np.ceil(np.diff(clock(trajectory.times)) / LONGEST_SLOWED_PERIOD_S).astype(int)
    pieces = [
        np.linspace(low, high, max(1, count), endpoint=False)
        for low, high, count in zip(trajectory.times[:-1], trajectory.times[1:], counts, strict=True)
    ]
    old = np.append(np.concatenate(pieces), trajectory.duration_s)
    positions, velocities, accelerations, _ = trajectory.at(old)
    factor, change = pace(old)[:, None], pace(old, 1)[:, None]
    return Trajectory(
        trajectory.joint_names,
        clock(old),
        positions,
        velocities / factor,
        (accelerations - velocities * change / factor) / factor**2,
    )


def with_limited_link_speed(
    model: RobotModel,
    trajectory: Trajectory,
    full_positions: Callable[[Array], Array],
    link: str,
    highest: float,
    velocity: Array,
    acceleration: Array,
) -> Trajectory:
    """Returns the motion along the same curve with the link at or below a speed at every sample.

    Args:
        model: see link_speeds.
        trajectory: see link_speeds.
        full_positions: see link_speeds.
        link: see link_speeds.
        highest: speed [m/s], above 0.
        velocity: limits of the joints, shape (joints,) [rad/s or m/s].
        acceleration: limits of the joints, shape (joints,) [rad/s^2 or m/s^2].
    """
    if len(trajectory.times) < 2:
        return trajectory
    allowed = highest * (1.0 - MARGIN)
    times = trajectory.sample_times(min(PERIOD_S, trajectory.duration_s / 20.0))
    slowing = link_speeds(model, trajectory, full_positions, link, times) / allowed
    if slowing.max() <= 1.0:
        return trajectory
    eased = _eased(trajectory, times, slowing)
    fastest = float(link_speeds(model, eased, full_positions, link, eased.sample_times()).max()) / allowed
    factor = max(fastest, overrun(eased, velocity * (1.0 - MARGIN), acceleration * (1.0 - MARGIN)))
    return eased.slowed(max(factor, 1.0))
