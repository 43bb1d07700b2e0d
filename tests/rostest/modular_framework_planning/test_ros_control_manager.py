# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of ros_control: found through their controller manager, started when a motion needs them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers
from moveit_commander import MoveGroupCommander

from modular_framework_control.ros.controller_manager_client import ControllerManagerClient

JOINTS = [f"panda_joint{number}" for number in range(1, 8)]
READY = dict(zip(JOINTS, [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785], strict=True))
LAUNCH = f"""<launch>
  <include file="$(find panda_moveit_config)/launch/move_group.launch">
    <arg name="load_robot_description" value="true"/>
    <arg name="moveit_controller_manager" value="ros_control"/>
  </include>
  <include file="$(find panda_moveit_config)/launch/ros_controllers.launch"/>
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen" required="true">
    <rosparam>
      joints: [{", ".join(JOINTS)}, panda_finger_joint1]
      initial_positions: {READY}
    </rosparam>
  </node>
  <rosparam>
    joint_state_controller: {{type: joint_state_controller/JointStateController, publish_rate: 50}}
    jog_controller: {{type: position_controllers/JointGroupPositionController, joints: [{", ".join(JOINTS)}]}}
  </rosparam>
  <node pkg="controller_manager" type="spawner" name="states" args="joint_state_controller"/>
</launch>"""


@pytest.fixture(scope="module")
def arm(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[MoveGroupCommander]:
    session = ros_launch(LAUNCH)
    session.wait_for_service("plan_kinematic_path", 120.0)
    wait_for_controllers(3)
    yield commander("panda_arm")


def commander(group: str) -> MoveGroupCommander:
    made = MoveGroupCommander(group, wait_for_servers=30.0)
    made.set_max_velocity_scaling_factor(1.0)
    made.set_max_acceleration_scaling_factor(1.0)
    return made


def states() -> dict[str, str]:
    answer = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)()
    return {controller.name: controller.state for controller in answer.controller}


def wait_for_controllers(count: int) -> None:
    rospy.wait_for_service("controller_manager/list_controllers", 30.0)
    end = rospy.Time.now() + rospy.Duration(30.0)
    while list(states().values()).count("running") < count:
        assert rospy.Time.now() < end, states()
        rospy.sleep(0.1)


def test_arm_and_hand_controller_share_a_motion(arm: MoveGroupCommander) -> None:
    both = commander("panda_arm_hand")
    goal = {**READY, "panda_joint1": 0.4, "panda_finger_joint1": 0.03}
    both.set_joint_value_target(goal)
    assert both.go()
    assert both.get_current_joint_values() == pytest.approx([*list(goal.values())[:7], 0.03, 0.03], abs=2e-3)


def test_a_stopped_controller_is_started_and_the_one_that_holds_its_joints_stopped(arm: MoveGroupCommander) -> None:
    manager = ControllerManagerClient("", 10.0)
    manager.load("jog_controller")
    manager.switch(["jog_controller"], ["arm_controller"])
    assert (states()["jog_controller"], states()["arm_controller"]) == ("running", "stopped")
    rospy.sleep(1.1)  # what move_group knows of the controllers is up to a second old
    arm.set_named_target("ready")
    assert arm.go()
    assert arm.get_current_joint_values() == pytest.approx(list(READY.values()), abs=2e-3)
    assert (states()["jog_controller"], states()["arm_controller"]) == ("stopped", "running")
