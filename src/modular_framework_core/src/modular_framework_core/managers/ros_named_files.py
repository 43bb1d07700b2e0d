# SPDX-License-Identifier: BSD-3-Clause
"""Reads files of named joint states, trajectories and poses as ROS messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core.files.yaml_entries import EntryError
from modular_framework_core.managers.joint_bounds import Bounds, bounds_from_urdf
from modular_framework_core.managers.named_joint_states import NamedJointState, load_joint_states
from modular_framework_core.managers.named_poses import NamedPose, Placement, load_poses
from modular_framework_core.managers.named_trajectories import JointLookup, TimedTrajectory, load_trajectories
from modular_framework_core.managers.ros_message_services import MessageServices
from modular_framework_core.msg import RobotPose
from modular_framework_core.srv import GetJointState
from modular_framework_ros.calls import CallError, wait_for_service

NamedMessages = tuple[dict[str, Any], list[EntryError]]


def joint_state_message(state: NamedJointState) -> JointState:
    """Returns a named joint state as a message without header, velocities and efforts."""
    return JointState(name=list(state.joint_names), position=list(state.positions))


def trajectory_message(trajectory: TimedTrajectory) -> JointTrajectory:
    """Returns a timed trajectory as a message with positions and times only."""
    points = [
        JointTrajectoryPoint(positions=list(positions), time_from_start=rospy.Duration.from_sec(time_s))
        for positions, time_s in trajectory.points
    ]
    return JointTrajectory(joint_names=list(trajectory.joint_names), points=points)


def pose_message(pose: NamedPose) -> PoseStamped:
    """Returns a named single pose as a message, stamped with the current time."""
    header = Header(stamp=rospy.Time.now(), frame_id=pose.reference_frame)
    return PoseStamped(header=header, pose=_pose(pose.placements[""]))


def robot_pose_message(pose: NamedPose) -> RobotPose:
    """Returns a named robot pose as a message, stamped with the current time."""
    header = Header(stamp=rospy.Time.now(), frame_id=pose.reference_frame)
    poses = [_pose(placement) for placement in pose.placements.values()]
    return RobotPose(end_effector_link_names=list(pose.placements), pose_array=PoseArray(header=header, poses=poses))


def _pose(placement: Placement) -> Pose:
    return Pose(Point(*placement.position_m), Quaternion(*placement.quaternion_xyzw))


def read_joint_states(path: Path) -> NamedMessages:
    """Reads a file of joint states and checks them against the joints of ``robot_description``, if set."""
    states, faults = load_joint_states(path, robot_bounds())
    return {state.name: joint_state_message(state) for state in states}, faults


def trajectory_reader(lookup: JointLookup) -> Callable[[Path], NamedMessages]:
    """Returns a reader of trajectory files with a given lookup of joint states."""

    def read(path: Path) -> NamedMessages:
        trajectories, faults = load_trajectories(path, lookup)
        return {trajectory.name: trajectory_message(trajectory) for trajectory in trajectories}, faults

    return read


def read_poses(path: Path) -> NamedMessages:
    """Reads the single poses in a file of poses."""
    poses, faults = load_poses(path)
    return {pose.name: pose_message(pose) for pose in poses if not pose.is_robot_pose}, faults


def read_robot_poses(path: Path) -> NamedMessages:
    """Reads the robot poses in a file of poses. Faults are reported by ``read_poses`` only."""
    poses, _ = load_poses(path)
    return {pose.name: robot_pose_message(pose) for pose in poses if pose.is_robot_pose}, []


def robot_bounds() -> Mapping[str, Bounds]:
    """Returns the limits of the robot's joints; empty without a valid ``robot_description``."""
    description = rospy.get_param_cached("robot_description", "")
    if not description:
        return {}
    try:
        return bounds_from_urdf(str(description))
    except ValueError as error:
        rospy.logwarn("Named joint states are not checked against the robot: %s", error)
        return {}


def joint_lookup(services: MessageServices) -> JointLookup:
    """Returns a lookup of joint states in the same process."""

    def lookup(name: str) -> Mapping[str, float] | None:
        if name not in services.store.names():
            return None
        state = services.store.get(name)
        return dict(zip(state.name, state.position, strict=False))

    return lookup


def lookup_over_service(timeout_s: float) -> JointLookup:
    """Returns a lookup of joint states in a different node. If the service does not appear, the lookup is empty.

    Args:
        timeout_s: Timeout of the wait for the service ``get_joint_state`` [s].
    """
    get_joint_state = rospy.ServiceProxy("get_joint_state", GetJointState)
    try:
        wait_for_service(get_joint_state, timeout_s)
    except CallError as error:
        rospy.logerr("%s (the joint state manager). No trajectory can be loaded.", error)
        return lambda name: None

    def lookup(name: str) -> Mapping[str, float] | None:
        try:
            response = get_joint_state(name)
        except rospy.ServiceException as error:
            rospy.logerr("Service '%s' failed for joint state '%s': %s", get_joint_state.resolved_name, name, error)
            return None
        if not response.success:
            return None
        return dict(zip(response.joint_state.name, response.joint_state.position, strict=False))

    return lookup
