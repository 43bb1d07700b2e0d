# SPDX-License-Identifier: BSD-3-Clause
"""Controllers commanded by a topic, and one of a package that a user wrote, as clients see them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import rospy
from control_msgs.msg import JointControllerState
from controller_manager_msgs.srv import ListControllers, ListControllerTypes, LoadController, SwitchController
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from modular_framework_testing.ros_session import until

MODULE = """
from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface

class Nodder(Controller):
    interface_class = PositionJointInterface

    def init(self, hw, root_nh, controller_nh):
        self._handle = hw.get_handle(controller_nh.get_param("joint"))
        return True

    def update(self, time_s, period_s):
        self._handle.command = 0.25
"""
LAUNCH = """
<launch>
  <rosparam>
    robot_hardware: [by_position, by_velocity]
    by_position: {{type: modular_framework_control/MockRobotHW, joints: [shoulder, elbow, neck]}}
    by_velocity: {{type: modular_framework_control/MockRobotHW, joints: [wheel, rail, slide],
                  command_interface: VelocityJointInterface}}
    states: {{type: joint_state_controller/JointStateController, publish_rate: 1000}}
    arm: {{type: position_controllers/JointGroupPositionController, joints: [shoulder, elbow]}}
    drive: {{type: velocity_controllers/JointVelocityController, joint: wheel}}
    lift: {{type: velocity_controllers/JointTrajectoryController, joints: [rail], gains: {{rail: {{p: 5.0}}}}}}
    nod: {{type: lab_nodder/Nodder, joint: neck}}
    push: {{type: velocity_controllers/JointPositionController, joint: slide, pid: {{p: 5.0, d: 0.0, i: 1.0,
           i_clamp: 0.5}}}}
  </rosparam>
  <env name="ROS_PACKAGE_PATH" value="{folder}:$(env ROS_PACKAGE_PATH)"/>
  <env name="PYTHONPATH" value="{folder}:$(env PYTHONPATH)"/>
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen" required="true"/>
</launch>
"""
CONTROLLERS = ["states", "arm", "drive", "lift", "nod", "push"]


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


@pytest.fixture(scope="module", autouse=True)
def robot(ros_launch: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("lab_nodder")
    (folder / "lab_nodder_controllers.py").write_text(MODULE)
    (folder / "package.xml").write_text(
        '<package format="3"><name>lab_nodder</name><version>0.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">a</maintainer><license>BSD-3-Clause</license>'
        '<export><modular_framework_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    (folder / "plugins.xml").write_text(
        '<library path="lab_nodder_controllers"><class name="lab_nodder/Nodder" type="Nodder" '
        'base_class_type="controller_interface::ControllerBase"/></library>'
    )
    session = ros_launch(LAUNCH.format(folder=folder))
    for name in CONTROLLERS:
        assert call("load_controller", LoadController, name).ok, name
    assert call("switch_controller", SwitchController, CONTROLLERS, [], 2, False, 0.0).ok
    return session


def wait_until(true_of: Callable[[dict[str, float]], bool], field: str = "position") -> None:
    deadline = time.monotonic() + 30.0
    while True:
        message = rospy.wait_for_message("joint_states", JointState, 30.0)
        values = dict(zip(message.name, getattr(message, field), strict=True))
        if true_of(values):
            return
        assert time.monotonic() < deadline, values


def publisher(topic: str, kind: Any) -> rospy.Publisher:
    endpoint = rospy.Publisher(topic, kind, queue_size=10)
    deadline = time.monotonic() + 30.0
    while endpoint.get_num_connections() == 0:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return endpoint


def test_a_group_goes_where_its_topic_says_and_ignores_what_does_not_fit() -> None:
    seen: set[tuple[float, float]] = set()
    subscriber = rospy.Subscriber(
        "joint_states",
        JointState,
        lambda message: seen.add(tuple(message.position[message.name.index(name)] for name in ("shoulder", "elbow"))),
    )
    command = publisher("arm/command", Float64MultiArray)
    command.publish(Float64MultiArray(data=[0.1, -0.2]))
    wait_until(lambda positions: positions["shoulder"] == 0.1 and positions["elbow"] == -0.2)
    for nonsense in ([], [1.0], [float("nan"), 1.0]):
        command.publish(Float64MultiArray(data=nonsense))
        time.sleep(0.1)
    command.publish(Float64MultiArray(data=[0.2, -0.2]))
    wait_until(lambda positions: positions["shoulder"] == 0.2)
    assert seen <= {(0.0, 0.0), (0.1, -0.2), (0.2, -0.2)}, "what comes in between was commanded by nonsense"
    subscriber.unregister()


def test_a_joint_turns_as_fast_as_its_topic_says() -> None:
    publisher("drive/command", Float64).publish(0.5)
    wait_until(lambda velocities: abs(velocities["wheel"] - 0.5) < 1e-6, "velocity")


def test_a_controller_with_gains_reports_what_it_sees_and_does() -> None:
    states: list[JointControllerState] = []
    subscriber = rospy.Subscriber("push/state", JointControllerState, states.append)
    publisher("push/command", Float64).publish(0.3)
    until(lambda: states and abs(states[-1].process_value - 0.3) < 1e-3, "the slide at its goal")
    subscriber.unregister()
    for state in states:
        assert (state.p, state.i, state.d, state.i_clamp, state.antiwindup) == (5.0, 1.0, 0.0, 0.5, False)
        assert state.error == pytest.approx(state.set_point - state.process_value)
        assert abs(state.command - 5.0 * state.error) <= 0.5 + 1e-9
    gaps = np.diff([state.header.stamp.to_sec() for state in states])
    assert gaps.min() > 0.04, "every tenth cycle of 8 ms, of which some are late"


def test_the_controller_of_a_user_is_listed_and_moves_its_joint() -> None:
    assert "lab_nodder/Nodder" in call("list_controller_types", ListControllerTypes).types
    listed = {entry.name: entry for entry in call("list_controllers", ListControllers).controller}
    assert [listed[name].state for name in CONTROLLERS] == ["running"] * len(CONTROLLERS)
    assert [claim.resources for claim in listed["nod"].claimed_resources] == [["neck"]]
    wait_until(lambda positions: positions["neck"] == 0.25)
