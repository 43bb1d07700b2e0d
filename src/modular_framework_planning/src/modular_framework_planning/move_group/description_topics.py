# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the robot's descriptions as texts, for nodes that take them from a topic as MoveIt 2's do."""

from __future__ import annotations

import rospy
from std_msgs.msg import String

from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_planning.move_group.robot_parameters import DESCRIPTION
from modular_framework_ros.parameter_search import nearest_parameter


def publish_descriptions() -> None:
    """Publishes what ~planning_scene_monitor/publish_robot_description and publish_robot_description_semantic ask for.

    Publishes: robot_description, robot_description_semantic (std_msgs/String, latched).
    """
    for topic in (DESCRIPTION, f"{DESCRIPTION}_semantic"):
        if parameter(f"~planning_scene_monitor/publish_{topic}"):
            publisher = rospy.Publisher(topic, String, queue_size=1, latch=True)
            publisher.publish(str(rospy.get_param(nearest_parameter(topic))))
