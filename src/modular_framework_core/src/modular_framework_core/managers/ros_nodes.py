# SPDX-License-Identifier: BSD-3-Clause
"""Starts the managers: all of them in one node, or one of them in a node of its own."""

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
from modular_framework_ros.service_backlog import widen_backlog
from modular_framework_ros.start_up import start_timeout

TOPICS_IN_LOG_PARAMETER = "/rosout_disable_topics_generation"
COLLECT_AFTER = 50_000  # objects; messages are freed by reference counts, and five plans are a few thousand objects


def start(node_name: str) -> list[str]:
    """Starts a node and returns its arguments without the remappings of ROS; an empty one may stand for a missing one.

    rospy asks the master for the parameter of the topics in the log at every line, as long as nobody has set it: half a
    request's time. Where it is not set it gets the value that has the same meaning.
    """
    rospy.init_node(node_name)
    widen_backlog()
    if not rospy.has_param(TOPICS_IN_LOG_PARAMETER):
        rospy.set_param(TOPICS_IN_LOG_PARAMETER, False)
    gc.freeze()  # looking for cycles among the modules, at every tenth file loaded, took 20 ms
    gc.set_threshold(COLLECT_AFTER)
    return list(rospy.myargv(sys.argv)[1:])


def run_message_manager(kind: MessageKind, node_name: str) -> None:
    """Runs the manager of one kind of message; argument: optional file of named messages, where the kind has such."""
    arguments = [argument for argument in start(node_name) if argument]
    readers = {kinds.JOINT_STATE: read_joint_states, kinds.POSE: read_poses, kinds.ROBOT_POSE: read_robot_poses}
    if kind is kinds.TRAJECTORY and arguments:
        readers[kind] = trajectory_reader(lookup_over_service(start_timeout()))
    named = NamedFile(Path(arguments[0]), readers[kind]) if arguments and kind in readers else None
    MessageServices(kind, named).connect()
    rospy.spin()


def run_acm_manager() -> None:
    """Runs the manager of the allowed collision matrix."""
    start("acm_manager_server")
    AcmServices().connect()
    rospy.spin()


def run_object_types() -> None:
    """Runs the map of simulated objects to their types."""
    start("gazebo_mapping_server")
    ObjectTypeServices().connect()
    rospy.spin()


def run_all() -> None:
    """Runs every manager in one node.

    Arguments (all optional, empty for none): file of named joint states, of named trajectories, of named poses. The
    parameters ``~named_joint_states_file``, ``~named_trajectories_file`` and ``~named_poses_file`` do the same. The
    file of poses may be missing: older configurations have none.
    """
    arguments = [*start("managers"), "", "", ""]
    read = DeclaredParameters("modular_framework_core", "managers").values
    given = read("~named_joint_states_file", "~named_trajectories_file", "~named_poses_file")
    files = [path or argument for path, argument in zip(given, arguments, strict=False)]

    def named(path: str, read: Callable[[Path], NamedMessages]) -> NamedFile | None:
        return NamedFile(Path(path), read) if path else None

    if files[2] and not Path(files[2]).exists():
        rospy.loginfo("There is no file of named poses: %s", files[2])
        files[2] = ""
    joint_states = MessageServices(kinds.JOINT_STATE, named(files[0], read_joint_states))
    services = [
        joint_states,
        MessageServices(kinds.TRAJECTORY, named(files[1], trajectory_reader(joint_lookup(joint_states)))),
        MessageServices(kinds.POSE, named(files[2], read_poses)),
        MessageServices(kinds.ROBOT_POSE, named(files[2], read_robot_poses)),
        MessageServices(kinds.PLAN),
        MessageServices(kinds.GRASP),
    ]
    for service in (*services, AcmServices(), ObjectTypeServices()):
        service.connect()
    rospy.spin()
