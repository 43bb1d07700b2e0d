# SPDX-License-Identifier: BSD-3-Clause
"""A list of hardware, one of a package that a user wrote, run as one robot by the node robot_hw."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers, LoadController, SwitchController
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

MODULE = """
import time

import rospy
from std_msgs.msg import Bool
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW

class LabGripper(MockRobotHW):
    announces_ready = True

    def init(self, root_nh, robot_hw_nh):
        rospy.Subscriber("switch_on", Bool, self._on_switch)
        self._ready = rospy.Publisher(robot_hw_nh.get_param("topic_to_wait_for"), Bool, queue_size=1, latch=True)
        return super().init(root_nh, robot_hw_nh)

    def _on_switch(self, message):
        self._ready.publish(message.data)

class LabSnail(MockRobotHW):
    def write(self, time_s, period_s):
        super().write(time_s, period_s)
        time.sleep(0.03)
"""
ENVIRONMENT = """
  <env name="ROS_PACKAGE_PATH" value="{folder}:$(env ROS_PACKAGE_PATH)"/>
  <env name="PYTHONPATH" value="{folder}:$(env PYTHONPATH)"/>
"""
LAUNCH = """
<launch>
  <rosparam>
    robot_hardware: [arm_hw, gripper_hw]
    arm_hw: {{type: modular_framework_control/MockRobotHW, joints: [shoulder, elbow], topic_to_wait_for: arm_ready}}
    gripper_hw: {{type: lab_gripper/LabGripper, joints: [finger], topic_to_wait_for: gripper_ready}}
    joint_state_controller: {{type: joint_state_controller/JointStateController, publish_rate: 50}}
  </rosparam>
  {environment}
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen"/>
</launch>
"""
FAILING = """
<launch>
  {environment}
  <node pkg="modular_framework_control" type="robot_hw" name="slow_hw" output="screen">
    <rosparam>{{type: lab_gripper/LabGripper, joints: [finger], topic_to_wait_for: never_said, ready_timeout: 1}}
    </rosparam>
  </node>
  <node pkg="modular_framework_control" type="robot_hw" name="unknown_hw" output="screen">
    <rosparam>{{type: lab_gripper/LabLeg}}</rosparam>
  </node>
  <node pkg="modular_framework_control" type="robot_hw" name="late_hw" output="screen">
    <rosparam>{{type: lab_gripper/LabSnail, joints: [finger], rate: 50}}</rosparam>
  </node>
</launch>
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Settings under which the user's package is found."""
    folder = tmp_path_factory.mktemp("lab_gripper")
    (folder / "lab_gripper_hw.py").write_text(MODULE)
    (folder / "package.xml").write_text(
        '<package format="3"><name>lab_gripper</name><version>0.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">a</maintainer><license>BSD-3-Clause</license>'
        '<export><modular_framework_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    (folder / "plugins.xml").write_text(
        '<library path="lab_gripper_hw"><class name="lab_gripper/LabGripper" type="LabGripper" '
        'base_class_type="hardware_interface::RobotHW"/><class name="lab_gripper/LabSnail" type="LabSnail" '
        'base_class_type="hardware_interface::RobotHW"/></library>'
    )
    return ENVIRONMENT.format(folder=Path(folder))


def says(topic: str, timeout_s: float) -> bool:
    said = threading.Event()
    subscriber = rospy.Subscriber(topic, Bool, lambda message: said.set() if message.data else None)
    answer = said.wait(timeout_s)
    subscriber.unregister()
    return answer


def test_controllers_can_be_loaded_once_every_listed_hardware_is_ready(
    ros_launch: Callable[..., Any], environment: str
) -> None:
    ros_launch(LAUNCH.format(environment=environment))
    switch_on = rospy.Publisher("switch_on", Bool, queue_size=1, latch=True)
    deadline = time.monotonic() + 60.0
    while switch_on.get_num_connections() == 0:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert not says("arm_ready", 0.5)
    with pytest.raises(rospy.ROSException):
        rospy.wait_for_service("controller_manager/list_controllers", 0.2)
    switch_on.publish(True)
    assert says("gripper_ready", 30.0) and says("arm_ready", 30.0)
    rospy.wait_for_service("controller_manager/list_controllers", 30.0)
    switch_on.unregister()


def test_a_controller_sees_the_joints_of_all_hardware() -> None:
    name = "joint_state_controller"
    assert rospy.ServiceProxy("controller_manager/load_controller", LoadController)(name).ok
    assert rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)([name], [], 2, False, 0.0).ok
    assert set(rospy.wait_for_message("joint_states", JointState, 30.0).name) == {"shoulder", "elbow", "finger"}
    listed = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)().controller
    assert [(entry.name, entry.state) for entry in listed] == [(name, "running")]


def test_hardware_that_is_not_ready_unknown_or_late_is_reported(
    ros_launch: Callable[..., Any], environment: str
) -> None:
    session = ros_launch(FAILING.format(environment=environment))
    expected = (
        "waited 1 s in vain for True on topic /never_said of hardware '/slow_hw'",
        "unknown hardware type 'lab_gripper/LabLeg'",
        "known: lab_gripper/LabGripper, lab_gripper/LabSnail, modular_framework_control/",
        "cycles overran",
        "the period is 20.0 ms",
    )
    deadline = time.monotonic() + 60.0
    while not all(words in session.log() for words in expected):
        assert time.monotonic() < deadline, session.log()
        time.sleep(0.1)
