# SPDX-License-Identifier: BSD-3-Clause
"""The test of a node with an emulated gripper: run it with ``./install.sh exec python3 -m pytest <this file>``."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import rospy
from actionlib import SimpleActionClient
from control_msgs.msg import GripperCommand, GripperCommandAction, GripperCommandGoal
from sensor_msgs.msg import JointState

from modular_framework_testing.emulators.command_port import send_command
from modular_framework_testing.ros_session import RosSession, free_port, until

LAUNCH = """<launch>
  <arg name="port"/>
  <arg name="command_port"/>
  <include file="$(find modular_framework_testing)/launch/emulators.launch">
    <arg name="arm" value="false"/>
    <arg name="gripper_port" value="$(arg port)"/>
    <arg name="gripper_command_port" value="$(arg command_port)"/>
  </include>
  <rosparam subst_value="true">
    robot_hardware: [gripper]
    gripper: {type: modular_framework_drivers/EzGripperRobotHW, port_name: $(arg port), link_timeout: 0.5}
    joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 50}
    gripper_controller: {type: position_controllers/GripperActionController, joint: ezgripper_knuckle_palm_L1_1}
  </rosparam>
  <node name="robot_hw" pkg="modular_framework_control" type="robot_hw" output="screen"/>
  <node name="spawner" pkg="controller_manager" type="spawner" output="screen"
        args="joint_state_controller gripper_controller"/>
</launch>"""


@dataclass(frozen=True)
class Gripper:
    """The running launch: replace the nodes by yours, and these members by their topics, services and actions."""

    session: RosSession
    command_port: int
    client: SimpleActionClient
    positions: list[float]

    def close(self) -> SimpleActionClient:
        """Closes the fingers; returns the client after the end of the goal."""
        self.client.send_goal(GripperCommandGoal(GripperCommand(position=1.9, max_effort=0.5)))
        assert self.client.wait_for_result(rospy.Duration(30)), self.session.log()
        return self.client


@pytest.fixture(scope="module")
def gripper(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gripper]:
    """The gripper with open fingers."""
    session, port, command_port = RosSession(), Path(tmp_path_factory.mktemp("line"), "gripper"), free_port()
    positions: list[float] = []
    try:
        session.start_master()
        os.environ.update(session.env)
        rospy.init_node("test", disable_signals=True)
        rospy.Subscriber("joint_states", JointState, lambda message: positions.append(message.position[0]))
        session.launch(LAUNCH, port=port, command_port=command_port)
        client = SimpleActionClient("gripper_controller/gripper_cmd", GripperCommandAction)
        assert client.wait_for_server(rospy.Duration(60)), session.log()
        until(lambda: positions and positions[-1] < 0.03, "open fingers", 60.0)
        yield Gripper(session, command_port, client, positions)
    finally:
        rospy.signal_shutdown("end of the tests")
        session.stop()


def test_fingers_stop_at_an_object(gripper: Gripper) -> None:
    """The object meets the fingers at 1.2 rad."""
    send_command(gripper.command_port, "object", position=1.2)
    assert gripper.close().get_result().stalled
    until(lambda: abs(gripper.positions[-1] - 1.2) < 0.05, "fingers at the object")


def test_a_goal_ends_with_the_cause_if_the_power_fails(gripper: Gripper) -> None:
    """Devices fail in a test as on the robot."""
    send_command(gripper.command_port, "power_off")
    assert "does not respond" in gripper.close().get_goal_status_text()
