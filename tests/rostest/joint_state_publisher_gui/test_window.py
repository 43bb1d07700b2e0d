# SPDX-License-Identifier: BSD-3-Clause
"""The window that launch files start for use_gui:=true publishes joint states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.msg import JointState

ROD = """<robot name='rod'><link name='a'/><link name='b'/><joint name='turn' type='revolute'><parent link='a'/>
<child link='b'/><axis xyz='0 0 1'/><limit lower='-0.3' upper='1.7' effort='1' velocity='1'/></joint></robot>"""


def test_the_window_publishes_the_joints(ros_launch: Callable[..., Any]) -> None:
    text = ROD.replace("<", "&lt;").replace("\n", " ")
    ros_launch(f"""<launch><param name="robot_description" value="{text}"/>
      <node pkg="joint_state_publisher_gui" type="joint_state_publisher_gui" name="window" output="screen"
            launch-prefix="xvfb-run -a"/></launch>""")
    state = rospy.wait_for_message("joint_states", JointState, 60.0)
    assert list(state.name) == ["turn"] and abs(state.position[0]) < 0.01
