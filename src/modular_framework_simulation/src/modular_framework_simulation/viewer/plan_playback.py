# SPDX-License-Identifier: BSD-3-Clause
"""The motion planned last, for its replay: positions at every time, from messages of `display_planned_path`."""

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
    """A motion of some joints.

    Attributes:
        start: Positions of all joints at the beginning [rad or m].
        joints: Those that move.
        times: From the beginning to each waypoint, shape (n,), not decreasing [s].
        waypoints: shape (n, joints) [rad or m].
    """

    start: Mapping[str, float]
    joints: tuple[str, ...]
    times: NDArray[np.float64]
    waypoints: NDArray[np.float64]

    @property
    def duration_s(self) -> float:
        """How long the motion takes [s]."""
        return float(self.times[-1])

    def positions_at(self, time_s: float) -> dict[str, float]:
        """Returns the positions of all joints at a time from the beginning [s]; between waypoints, on a line."""
        row = [float(np.interp(time_s, self.times, column)) for column in self.waypoints.T]
        return {**self.start, **dict(zip(self.joints, row, strict=True))}

    def line(self, links: RobotLinks) -> NDArray[np.float64]:
        """Returns the way of the last link that moves, in the frame of the robot's root, shape (points, 3) [m]."""
        tip = links.tip(self.joints)
        times = np.linspace(0.0, self.duration_s, _LINE_POINTS)
        return np.array([links.poses(self.positions_at(time))[tip].position for time in times])


def plan_of(message: Any) -> Plan | None:
    """Returns the motion of a moveit_msgs/DisplayTrajectory; None where it has none.

    Raises:
        ValueError: Its numbers do not fit together.
    """
    start = finite_positions(message.trajectory_start.joint_state.name, message.trajectory_start.joint_state.position)
    joints: dict[str, None] = {}
    for part in message.trajectory:
        joints |= dict.fromkeys(part.joint_trajectory.joint_names)
    now = dict(start)
    times, waypoints, begin_s = [], [], 0.0
    for part in message.trajectory:
        for point in part.joint_trajectory.points:
            now |= finite_positions(part.joint_trajectory.joint_names, point.positions)
            times.append(begin_s + point.time_from_start.to_sec())
            waypoints.append([now.get(name, 0.0) for name in joints])
        begin_s = times[-1] if times else 0.0
    if not waypoints:
        return None
    if any(after < before for before, after in zip(times, times[1:], strict=False)):
        raise ValueError("the times of the waypoints decrease")
    if times[-1] == times[0]:  # without times: a waypoint every tenth of a second
        times = [0.1 * index for index in range(len(times))]
    return Plan(start, tuple(joints), np.array(times), np.array(waypoints, dtype=np.float64))
