# SPDX-License-Identifier: BSD-3-Clause
"""Shakes the arm with a held object through the arm's trajectory controller."""

from __future__ import annotations

from typing import Any

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.episodes.shake_motion import shake_motion
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import wait_for_action, wait_for_result
from modular_framework_urdf.joint_limits import JointLimits, known_limits
from modular_framework_urdf.urdf_reader import read_urdf

ACTION_TIMEOUT_S = 30.0


class ShakeError(RuntimeError):
    """The object could not be shaken; the message gives the reason."""


def shake(samples: Samples, duration_s: float) -> float:
    """Shakes the arm and waits for the end.

    Args:
        samples: Messages collected so far.
        duration_s: Duration [s of simulated time].

    Returns:
        ROS time of the start [s].

    Raises:
        ShakeError: There is no trajectory controller, a joint limit is invalid, or the controller rejects or aborts
            the motion.
        CallError: The controller does not answer.
    """
    controller, joints, positions = _arm(samples)
    times, points, speeds = shake_motion(positions, _limits(), joints, duration_s)
    action = f"/{controller}/follow_joint_trajectory"
    client = SteadyActionClient(action, FollowJointTrajectoryAction)
    wait_for_action(client, action, ACTION_TIMEOUT_S)
    trajectory = JointTrajectory(joint_names=joints)
    trajectory.points = [
        JointTrajectoryPoint(positions=point, velocities=speed, time_from_start=rospy.Duration.from_sec(time_s))
        for time_s, point, speed in zip(times.tolist(), points.tolist(), speeds.tolist(), strict=True)
    ]
    started_s = rospy.get_time()
    client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory))
    if wait_for_result(client, ACTION_TIMEOUT_S + duration_s) != GoalStatus.SUCCEEDED:
        raise ShakeError(f"controller '{controller}' did not shake the arm: {client.get_goal_status_text()}")
    return started_s


def _arm(samples: Samples) -> tuple[str, list[str], Any]:
    """Returns the trajectory controller with the most joints, its joint names and their positions."""
    latest = {name: message for name, message in samples.controllers}
    if not latest:
        raise ShakeError("no trajectory controller publishes its state, which a shake needs; start one")
    name = max(latest, key=lambda controller: (len(latest[controller].joint_names), controller))
    message = latest[name]
    return name, list(message.joint_names), np.array(message.desired.positions)


def _limits() -> dict[str, JointLimits]:
    """Returns the limits of all joints from the robot description and joint_limits.yaml.

    Raises:
        ShakeError: A limit is invalid.
    """
    robot = read_urdf(str(rospy.get_param("/robot_description")))
    entries = rospy.get_param("/robot_description_planning/joint_limits", {})
    found = {}
    for joint in robot.joints:
        try:
            found[joint.name] = known_limits(joint, entries.get(joint.name) or {})
        except ValueError as error:
            raise ShakeError(f"the arm was not shaken: {error}") from error
    return found
