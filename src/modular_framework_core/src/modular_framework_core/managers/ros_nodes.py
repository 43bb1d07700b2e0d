# SPDX-License-Identifier: BSD-3-Clause
"""Starts the managers: all of them in one node, or one of them in a node of its own."""
from __future__ import annotations

import sys
from pathlib import Path

import rospy

from modular_framework_core.managers import ros_message_services as kinds
from modular_framework_core.managers.ros_acm_services import AcmServices
from modular_framework_core.managers.ros_message_services import MessageKind, MessageServices
from modular_framework_core.managers.ros_named_files import (
    fill_joint_states,
    fill_trajectories,
    lookup_in,
    lookup_over_service,
)
from modular_framework_core.managers.ros_object_type_services import ObjectTypeServices

JOINT_STATE_SERVICE_TIMEOUT_S = 30.0


def start(node_name: str) -> list[str]:
    """Starts a node and returns its arguments without the remappings of ROS."""
    rospy.init_node(node_name)
    return [argument for argument in rospy.myargv(sys.argv)[1:] if argument]


def run_message_manager(kind: MessageKind, node_name: str) -> None:
    """Runs the manager of one kind of message that reads no file."""
    start(node_name)
    MessageServices(kind).connect()
    rospy.spin()


def run_joint_state_manager() -> None:
    """Runs the joint state manager; argument: optional file of named joint states."""
    arguments = start("joint_state_manager_server")
    services = MessageServices(kinds.JOINT_STATE)
    if arguments:
        fill_joint_states(services, Path(arguments[0]))
    services.connect()
    rospy.spin()


def run_trajectory_manager() -> None:
    """Runs the trajectory manager; argument: optional file of named trajectories."""
    arguments = start("joint_trajectory_manager_server")
    services = MessageServices(kinds.TRAJECTORY)
    if arguments:
        fill_trajectories(services, Path(arguments[0]), lookup_over_service(JOINT_STATE_SERVICE_TIMEOUT_S))
    services.connect()
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

    Arguments (both optional): file of named joint states, file of named trajectories. The parameters
    ``~named_joint_states_file`` and ``~named_trajectories_file`` do the same.
    """
    arguments = start("managers")
    joint_states, trajectories = MessageServices(kinds.JOINT_STATE), MessageServices(kinds.TRAJECTORY)
    states_file = str(rospy.get_param("~named_joint_states_file", arguments[0] if arguments else ""))
    trajectories_file = str(rospy.get_param("~named_trajectories_file", arguments[1] if len(arguments) > 1 else ""))
    if states_file:
        fill_joint_states(joint_states, Path(states_file))
    if trajectories_file:
        fill_trajectories(trajectories, Path(trajectories_file), lookup_in(joint_states))
    others = [MessageServices(kind) for kind in (kinds.POSE, kinds.ROBOT_POSE, kinds.PLAN, kinds.GRASP)]
    for services in (joint_states, trajectories, *others, AcmServices(), ObjectTypeServices()):
        services.connect()
    rospy.spin()
