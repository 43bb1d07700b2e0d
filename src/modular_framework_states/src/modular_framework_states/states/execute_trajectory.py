# SPDX-License-Identifier: BSD-3-Clause
"""A state that executes a trajectory that was written instead of planned."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Unpack

import numpy as np
import rospy
from moveit_msgs.msg import RobotTrajectory
from moveit_msgs.srv import GetStateValidity, GetStateValidityRequest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core.commander.moveit_requests import robot_state
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative, Positive
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError, call_service, wait_for_service
from modular_framework_states.arm_positions import run_to_end
from modular_framework_states.manager_clients import ManagerError, selected_or_named
from modular_framework_states.smooth_timing import smooth_timing

TIMEOUT_S = 10.0
ROUNDING_S = 0.01


class ExecuteTrajectory(FrameworkState):
    """Executes a trajectory of the trajectory manager from the current position; positive if the arm is at its end.

    The motion from the current position to the first point is included. As no planner has checked the trajectory, its
    path is first checked for collisions, and each segment for the joints' maximum velocities. Points without velocities
    are passed smoothly. If the smooth motion would exceed maximum velocities or accelerations, it takes longer.

    Args:
        trajectory_name: Name of the trajectory; empty for the oldest anonymous trajectory. The input key
            ``selected_trajectory`` replaces it.
        step: Distance between collision checks [rad or m]; 0 for none.
        goal_tolerance: Maximum deviation from the last point after the motion [rad or m].
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        trajectory_name: Annotated[str, Named("trajectory")] = "",
        step: NotNegative = 0.05,
        goal_tolerance: Positive = 0.03,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._name, self._step, self._goal_tolerance = trajectory_name, float(step), float(goal_tolerance)

    def execute(self, userdata: Any) -> str:
        """Checks the path and executes the trajectory."""
        commander = userdata.arm_commander
        label = f"trajectory '{self._name or 'selected'}'"
        try:
            trajectory = selected_or_named(self, userdata, "trajectory", self._name)
            trajectory = start_at_current(trajectory, commander.current_joints())
            limits = {joint.name: (joint.velocity, joint.acceleration) for joint in commander.group.joints}
            fault = velocity_violation(trajectory, {name: velocity for name, (velocity, _) in limits.items()})
            if not fault:
                trajectory = self._smooth(trajectory, limits, label)
            if not fault and self._step:
                fault = self._first_contact(commander, trajectory)
        except (ManagerError, CallError, ValueError) as error:
            return self.fail(f"{label}: {error}")
        if self.preempt_requested():
            return self.stopped()
        if fault:
            return self.fail(f"{label} was not executed: {fault}")
        return run_to_end(self, commander, RobotTrajectory(joint_trajectory=trajectory), self._goal_tolerance, label)

    def _smooth(
        self, trajectory: JointTrajectory, limits: Mapping[str, tuple[float, float]], label: str
    ) -> JointTrajectory:
        result = with_smooth_timing(trajectory, limits)
        asked_s, needed_s = (each.points[-1].time_from_start.to_sec() for each in (trajectory, result))
        if needed_s > asked_s + ROUNDING_S:
            rospy.loginfo(
                "%s takes %.2f s instead of %.2f s, as the joints need more time at their maximum velocities and "
                "accelerations",
                label,
                needed_s,
                asked_s,
            )
        return result

    def _first_contact(self, commander: Any, trajectory: JointTrajectory) -> str:
        """Describes the first collision on the path; empty if the path is free."""
        proxy = rospy.ServiceProxy("check_state_validity", GetStateValidity)
        wait_for_service(proxy, TIMEOUT_S)
        for number, positions in sample_path(trajectory, self._step):
            if self.preempt_requested():
                return ""
            joints = dict(zip(trajectory.joint_names, positions, strict=True))
            request = GetStateValidityRequest(robot_state=robot_state(joints), group_name=commander.group_name)
            response = call_service(proxy, request, TIMEOUT_S)
            if not response.valid:
                pairs = sorted({f"'{item.contact_body_1}' with '{item.contact_body_2}'" for item in response.contacts})
                return (
                    f"on the way to point {number} the robot would be in collision "
                    f"({', '.join(pairs[:3]) or 'move_group says only that the state is not valid'})"
                )
        return ""


def start_at_current(trajectory: JointTrajectory, current: Mapping[str, float]) -> JointTrajectory:
    """Returns a trajectory that starts at the current position, added at time 0 if the first point comes later.

    Raises:
        ValueError: The trajectory has no points or unknown joints, or the number of positions is wrong.
    """
    unknown = [joint for joint in trajectory.joint_names if joint not in current]
    lengths = {len(point.positions) for point in trajectory.points}
    if not trajectory.points or unknown or lengths != {len(trajectory.joint_names)}:
        raise ValueError(
            f"it has {len(trajectory.points)} points of {sorted(lengths)} positions for "
            f"{len(trajectory.joint_names)} joints, and the joints {unknown} are not joints of the arm: "
            f"{', '.join(current)}"
        )
    if trajectory.points[0].time_from_start.to_sec() <= 0.0:
        return trajectory
    start = JointTrajectoryPoint(
        positions=[current[joint] for joint in trajectory.joint_names], time_from_start=rospy.Duration(0)
    )
    return JointTrajectory(joint_names=trajectory.joint_names, points=[start, *trajectory.points])


def velocity_violation(trajectory: JointTrajectory, limits: Mapping[str, float]) -> str:
    """Describes the first segment that exceeds a joint's velocity limit; empty if all segments respect the limits.

    Args:
        trajectory: Points at increasing times.
        limits: Maximum velocity of each joint [rad/s or m/s].
    """
    for number, (start, end) in enumerate(pairwise(trajectory.points), start=1):
        time_s = (end.time_from_start - start.time_from_start).to_sec()
        distances = np.abs(np.subtract(end.positions, start.positions))
        needed = {
            joint: distance / limits[joint] for joint, distance in zip(trajectory.joint_names, distances, strict=True)
        }
        slowest = max(needed, key=needed.__getitem__)
        if needed[slowest] > time_s:
            return (
                f"joint '{slowest}' has {time_s:.2f} s to get to point {number} and needs {needed[slowest]:.2f} s "
                f"at its maximum velocity, {limits[slowest]:.2f} rad/s or m/s; give that point more time"
            )
    return ""


def with_smooth_timing(trajectory: JointTrajectory, limits: Mapping[str, tuple[float, float]]) -> JointTrajectory:
    """Returns a trajectory with velocities and, if required, later times; points with velocities are not changed.

    Args:
        trajectory: Points at increasing times.
        limits: Maximum velocity and acceleration of each joint [rad/s, rad/s^2 or m/s, m/s^2].

    Raises:
        ValueError: The times do not increase.
    """
    points = trajectory.points
    if len(points) < 2 or any(point.velocities for point in points):
        return trajectory
    timing = smooth_timing(
        np.array([point.time_from_start.to_sec() for point in points]),
        np.array([point.positions for point in points], dtype=float),
        *np.array([limits[joint] for joint in trajectory.joint_names], dtype=float).T,
    )
    return JointTrajectory(
        header=trajectory.header,
        joint_names=trajectory.joint_names,
        points=[
            JointTrajectoryPoint(
                positions=point.positions, velocities=velocities, time_from_start=rospy.Duration.from_sec(time_s)
            )
            for point, velocities, time_s in zip(points, timing.velocities.tolist(), timing.times.tolist(), strict=True)
        ],
    )


def sample_path(trajectory: JointTrajectory, step: float) -> list[tuple[int, list[float]]]:
    """Returns states on the segments between points, each with the index of the segment's end point.

    A segment is a cubic if its points have velocities, and a straight line otherwise, as for the controller.
    """
    points = trajectory.points
    result = [(0, list(points[0].positions))]
    for number, (start, end) in enumerate(pairwise(points), start=1):
        move = np.subtract(end.positions, start.positions)
        slopes, largest = (move, move), float(np.abs(move).max())  # changes per fraction of the segment
        if start.velocities and end.velocities:
            duration_s = (end.time_from_start - start.time_from_start).to_sec()
            slopes = (duration_s * np.asarray(start.velocities), duration_s * np.asarray(end.velocities))
            largest = float(np.abs([1.5 * move, *slopes]).max())
        count = max(1, int(np.ceil(largest / step)))
        for s in np.arange(1, count + 1) / count:
            rise, leave, arrive = s * s * (3.0 - 2.0 * s), s * (1.0 - s) ** 2, s * s * (s - 1.0)
            result.append((number, (start.positions + rise * move + leave * slopes[0] + arrive * slopes[1]).tolist()))
    return result
