# SPDX-License-Identifier: BSD-3-Clause
"""Runs all managers in one node, or one manager in its own node."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from pathlib import Path

import rospy

from modular_framework_core.managers import ros_message_services as kinds
from modular_framework_core.managers.ros_acm_services import AcmServices
from modular_framework_core.managers.ros_message_services import MessageKind, MessageServices, NamedFile
from modular_framework_core.managers.ros_named_files import (
    NamedMessages,
    joint_lookup,
    lookup_over_service,
    read_joint_states,
    read_poses,
    read_robot_poses,
    trajectory_reader,
)
from modular_framework_core.managers.ros_object_type_services import ObjectTypeServices
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.start_up import start_timeout

TOPICS_IN_LOG_PARAMETER = "/rosout_disable_topics_generation"
GC_THRESHOLD = 50_000  # [objects]; messages have no reference cycles, and five plans are a few thousand objects


def start(node_name: str) -> list[str]:
    """Starts a node and returns its command-line arguments without ROS remappings.

    Sets ``/rosout_disable_topics_generation`` to its default if unset: rospy otherwise queries the master at every log
    message, which takes half the time of a request.
    """
    rospy.init_node(node_name)
    if not rospy.has_param(TOPICS_IN_LOG_PARAMETER):
        rospy.set_param(TOPICS_IN_LOG_PARAMETER, False)
    gc.freeze()  # garbage collection over all modules took 20 ms at every tenth loaded file
    gc.set_threshold(GC_THRESHOLD)
    return list(rospy.myargv(sys.argv)[1:])


def run_message_manager(kind: MessageKind, node_name: str) -> None:
    """Runs the manager of one kind of message.

    Args:
        kind: Kind of the messages.
        node_name: Name of the node.

    Command-line argument (optional): file of named messages.
    """
    arguments = [argument for argument in start(node_name) if argument]
    readers = {kinds.JOINT_STATE: read_joint_states, kinds.POSE: read_poses, kinds.ROBOT_POSE: read_robot_poses}
    if kind is kinds.TRAJECTORY and arguments:
        readers[kind] = trajectory_reader(lookup_over_service(start_timeout()))
    named_file = NamedFile(Path(arguments[0]), readers[kind]) if arguments and kind in readers else None
    MessageServices(kind, named_file).connect()
    rospy.spin()


def run_acm_manager() -> None:
    """Runs the manager of the allowed collision matrix."""
    start("acm_manager_server")
    AcmServices().connect()
    rospy.spin()


def run_object_types() -> None:
    """Runs the manager of object types."""
    start("gazebo_mapping_server")
    ObjectTypeServices().connect()
    rospy.spin()


def run_all() -> None:
    """Runs all managers in one node.

    Command-line arguments (optional, "" for none): files of named joint states, named trajectories and named poses. The
    parameters ``~named_joint_states_file``, ``~named_trajectories_file`` and ``~named_poses_file`` take precedence. The
    file of poses may be missing, as in older configurations.
    """
    arguments = [*start("managers"), "", "", ""]
    read = DeclaredParameters("modular_framework_core", "managers").values
    parameters = read("~named_joint_states_file", "~named_trajectories_file", "~named_poses_file")
    files = [path or argument for path, argument in zip(parameters, arguments, strict=False)]

    def named_file(path: str, read: Callable[[Path], NamedMessages]) -> NamedFile | None:
        return NamedFile(Path(path), read) if path else None

    if files[2] and not Path(files[2]).exists():
        rospy.loginfo("There is no file of named poses: %s", files[2])
        files[2] = ""
    joint_states = MessageServices(kinds.JOINT_STATE, named_file(files[0], read_joint_states))
    services = [
        joint_states,
        MessageServices(kinds.TRAJECTORY, named_file(files[1], trajectory_reader(joint_lookup(joint_states)))),
        MessageServices(kinds.POSE, named_file(files[2], read_poses)),
        MessageServices(kinds.ROBOT_POSE, named_file(files[2], read_robot_poses)),
        MessageServices(kinds.PLAN),
        MessageServices(kinds.GRASP),
    ]
    for service in (*services, AcmServices(), ObjectTypeServices()):
        service.connect()
    rospy.spin()
