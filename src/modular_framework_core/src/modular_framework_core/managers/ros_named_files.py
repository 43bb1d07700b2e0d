# SPDX-License-Identifier: BSD-3-Clause
"""Fills the managers from the files of named joint states and named trajectories."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import rospy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core.managers.named_joint_states import NamedJointState, load_joint_states
from modular_framework_core.managers.named_trajectories import JointLookup, TimedTrajectory, load_trajectories
from modular_framework_core.managers.ros_message_services import MessageServices
from modular_framework_core.managers.yaml_entries import EntryError
from modular_framework_core.srv import GetJointState


def joint_state_message(state: NamedJointState) -> JointState:
    """Converts a named joint state; header, velocities and efforts stay empty."""
    return JointState(name=list(state.joint_names), position=list(state.positions))


def trajectory_message(trajectory: TimedTrajectory) -> JointTrajectory:
    """Converts a timed trajectory; only positions and times are filled."""
    points = [JointTrajectoryPoint(positions=list(positions), time_from_start=rospy.Duration.from_sec(time_s))
              for positions, time_s in trajectory.points]
    return JointTrajectory(joint_names=list(trajectory.joint_names), points=points)


def fill_joint_states(services: MessageServices, path: Path) -> None:
    """Stores the joint states of a file and logs every entry that is not usable."""
    states, faults = load_joint_states(path)
    _report(faults)
    for state in states:
        services.store.add(joint_state_message(state), state.name)
        rospy.loginfo("Loaded the joint state '%s'.", state.name)


def fill_trajectories(services: MessageServices, path: Path, lookup: JointLookup) -> None:
    """Stores the trajectories of a file and logs every entry that is not usable."""
    trajectories, faults = load_trajectories(path, lookup)
    _report(faults)
    for trajectory in trajectories:
        services.store.add(trajectory_message(trajectory), trajectory.name)
        rospy.loginfo("Loaded the trajectory '%s'.", trajectory.name)


def lookup_in(services: MessageServices) -> JointLookup:
    """Makes a lookup of joint states that live in the same process."""

    def lookup(name: str) -> Mapping[str, float] | None:
        if name not in services.store.names():
            return None
        state = services.store.get(name)
        return dict(zip(state.name, state.position, strict=False))

    return lookup


def lookup_over_service(timeout_s: float) -> JointLookup:
    """Makes a lookup of joint states that live in another node.

    Args:
        timeout_s: Longest wait for the service ``get_joint_state`` [s], spent at most once.

    Returns:
        The lookup; it knows nothing when the service does not appear, which is logged.
    """
    get_joint_state = rospy.ServiceProxy("get_joint_state", GetJointState)
    try:
        get_joint_state.wait_for_service(timeout_s)
    except rospy.ROSException:
        rospy.logerr("Service '%s' did not appear within %.1f s; start the joint state manager. "
                     "No trajectory can be loaded.", get_joint_state.resolved_name, timeout_s)
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


def _report(faults: list[EntryError]) -> None:
    for fault in faults:
        rospy.logerr("%s. This entry is skipped.", fault)
