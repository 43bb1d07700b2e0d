# SPDX-License-Identifier: BSD-3-Clause
"""Executes the targets of a policy with the trajectory controller of the arm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core.grasping.ros_manipulator_drivers import action_of, controller_with
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import wait_for_action

SERVER_TIMEOUT_S = 10.0


class PolicyMotionError(RuntimeError):
    """The arm cannot execute a chunk; the message gives the reason."""


def trajectory_action(controllers: Iterable[Mapping[str, Any]], joints: Sequence[str]) -> str:
    """Returns the action of the trajectory controller with given joints.

    Args:
        controllers: Entries of ``controller_list``: name, action_ns, type, joints.
        joints: Joints to move.

    Raises:
        PolicyMotionError: No trajectory controller has all joints.
    """
    entries = [entry for entry in controllers if entry.get("type") == "FollowJointTrajectory"]
    if (entry := controller_with(entries, joints)) is not None:
        return action_of(entry)
    known = {str(entry.get("name")): list(entry.get("joints", ())) for entry in entries}
    raise PolicyMotionError(
        f"no trajectory controller has all joints {list(joints)}; controller_list has {known}; correct "
        "the option joints"
    )


class PolicyArm:
    """Sends each chunk as one goal, which replaces the goal before; the controller holds the last target.

    Action client: ``<controller>/follow_joint_trajectory`` (control_msgs/FollowJointTrajectory).

    Args:
        action: Action of the controller.
        joints: Joints to move.
        rate_hz: Number of targets per second.
    """

    def __init__(self, action: str, joints: Sequence[str], rate_hz: float) -> None:
        self._action, self._joints, self._rate_hz = action, list(joints), rate_hz
        self._start_s = 0.0
        self._client = SteadyActionClient(action, FollowJointTrajectoryAction)

    def connect(self) -> None:
        """Waits for the controller.

        Raises:
            CallError: The controller is not there in time.
        """
        wait_for_action(self._client, self._action, SERVER_TIMEOUT_S)

    def start(self, targets: npt.NDArray[np.float64]) -> None:
        """Starts the motion through targets, shape (n, j) [rad or m]."""
        points = [
            JointTrajectoryPoint(
                positions=row.tolist(), time_from_start=rospy.Duration.from_sec(number / self._rate_hz)
            )
            for number, row in enumerate(targets, start=1)
        ]
        self._start_s = rospy.get_time()
        trajectory = JointTrajectory(joint_names=self._joints, points=points)
        self._client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory))

    def reached_targets(self) -> int:
        """Returns the number of targets whose time has passed since the start."""
        return int((rospy.get_time() - self._start_s) * self._rate_hz + 1e-6)

    def has_ended(self) -> bool:
        """Returns whether the controller has ended the goal."""
        return bool(self._client.gh is not None and self._client.gh.get_comm_state() == CommState.DONE)

    def fault(self) -> str:
        """Returns why the controller ended the goal without success; "" while the goal runs and after success."""
        if not self.has_ended() or self._client.get_state() == GoalStatus.SUCCEEDED:
            return ""
        result = self._client.get_result()
        reason = (result.error_string if result is not None else "") or self._client.get_goal_status_text()
        return f"controller action '{self._action}' ended the motion: {reason or 'no reason given'}"

    def stop(self) -> None:
        """Stops a running motion; the controller holds the arm."""
        if self._client.gh is not None and not self.has_ended():
            self._client.cancel_goal()
