# SPDX-License-Identifier: BSD-3-Clause
"""Publishers of the URDF and SRDF, for nodes that read robot descriptions from topics as in MoveIt 2."""

from __future__ import annotations

import rospy
from std_msgs.msg import String

from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_planning.move_group.robot_parameters import DESCRIPTION
from modular_framework_ros.parameter_search import nearest_parameter


def publish_descriptions() -> None:
    """Publishes URDF and SRDF if ~planning_scene_monitor/publish_robot_description[_semantic] are set.

    Publishes: robot_description, robot_description_semantic (std_msgs/String, latched).
    """
    for topic in (DESCRIPTION, f"{DESCRIPTION}_semantic"):
        if parameter(f"~planning_scene_monitor/publish_{topic}"):
            publisher = rospy.Publisher(topic, String, queue_size=1, latch=True)
            publisher.publish(str(rospy.get_param(nearest_parameter(topic))))
