# SPDX-License-Identifier: BSD-3-Clause
"""Reads the latest planned motion from `display_planned_path`, for its replay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.viewer.robot_links import RobotLinks, finite_positions

_LINE_POINTS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Motion of some joints.

    Attributes:
        start: Initial positions of all joints, by name [rad or m].
        joints: Names of the moving joints.
        times: Times of the waypoints from the start, shape (n,), non-decreasing [s].
        waypoints: Positions at the waypoints, shape (n, joints) [rad or m].
    """

    start: Mapping[str, float]
    joints: tuple[str, ...]
    times: NDArray[np.float64]
    waypoints: NDArray[np.float64]

    @property
    def duration_s(self) -> float:
        """Returns the duration of the motion [s]."""
        return float(self.times[-1])

    def positions_at(self, time_s: float) -> dict[str, float]:
        """Returns the positions of all joints at a time from the start [s], interpolated linearly."""
        row = [float(np.interp(time_s, self.times, column)) for column in self.waypoints.T]
        return {**self.start, **dict(zip(self.joints, row, strict=True))}

    def line(self, links: RobotLinks) -> NDArray[np.float64]:
        """Returns the path of the last moving link in the frame of the robot's root link, shape (points, 3) [m]."""
        tip = links.tip(self.joints)
        times = np.linspace(0.0, self.duration_s, _LINE_POINTS)
        return np.array([links.poses(self.positions_at(time))[tip].position for time in times])


def plan_of(message: Any) -> Plan | None:
    """Returns the motion in a moveit_msgs/DisplayTrajectory; None for an empty motion.

    Raises:
        ValueError: The numbers of joints and positions differ, or the times decrease.
    """
    start = finite_positions(message.trajectory_start.joint_state.name, message.trajectory_start.joint_state.position)
    joints: dict[str, None] = {}
    for part in message.trajectory:
        joints |= dict.fromkeys(part.joint_trajectory.joint_names)
    positions = dict(start)
    times, waypoints, start_s = [], [], 0.0
    for part in message.trajectory:
        for point in part.joint_trajectory.points:
            positions |= finite_positions(part.joint_trajectory.joint_names, point.positions)
            times.append(start_s + point.time_from_start.to_sec())
            waypoints.append([positions.get(name, 0.0) for name in joints])
        start_s = times[-1] if times else 0.0
    if not waypoints:
        return None
    if any(after < before for before, after in zip(times, times[1:], strict=False)):
        raise ValueError("the times of the waypoints decrease")
    if times[-1] == times[0]:  # a motion without times gets a waypoint every tenth of a second
        times = [0.1 * index for index in range(len(times))]
    return Plan(start, tuple(joints), np.array(times), np.array(waypoints, dtype=np.float64))
