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

TIMEOUT_S = 10.0


class ExecuteTrajectory(FrameworkState):
    """Executes a trajectory of the trajectory manager from the current position; positive if the arm is at its end.

    The motion from the current position to the first point is included. As no planner has checked the trajectory, its
    path is first checked for collisions, and each segment for the joints' maximum velocities.

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
            fault = velocity_violation(trajectory, {joint.name: joint.velocity for joint in commander.group.joints})
            if not fault and self._step:
                fault = self._first_contact(commander, trajectory)
        except (ManagerError, CallError, ValueError) as error:
            return self.fail(f"{label}: {error}")
        if self.preempt_requested():
            return self.stopped()
        if fault:
            return self.fail(f"{label} was not executed: {fault}")
        return run_to_end(self, commander, RobotTrajectory(joint_trajectory=trajectory), self._goal_tolerance, label)

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


def sample_path(trajectory: JointTrajectory, step: float) -> list[tuple[int, list[float]]]:
    """Returns states on the segments between points, each with the index of the segment's end point."""
    rows = [np.asarray(point.positions, dtype=float) for point in trajectory.points]
    result = [(0, rows[0].tolist())]
    for number, (start, end) in enumerate(zip(rows[:-1], rows[1:], strict=True), start=1):
        count = max(1, int(np.ceil(np.abs(end - start).max() / step)))
        result += [
            (number, (start + step_number / count * (end - start)).tolist()) for step_number in range(1, count + 1)
        ]
    return result
