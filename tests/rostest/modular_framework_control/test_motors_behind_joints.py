# SPDX-License-Identifier: BSD-3-Clause
"""Hardware of a user's package that knows motors, with the transmissions of the robot description in between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
import rospy
from controller_manager_msgs.srv import LoadController, SwitchController
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from modular_framework_testing.ros_session import until

MODULE = """
import math
from modular_framework_control.hardware_interface.joint_limits import JointLimitGuard
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_transmissions import RobotTransmissions

class Motors(RobotHW):
    def init(self, root_nh, robot_hw_nh):
        self._transmissions = RobotTransmissions(self, root_nh, ["m1", "m2", "m3"])
        self._guard = JointLimitGuard(self, root_nh)
        for name, position in {"m1": 0.0, "m2": 0.0, "m3": 20.0}.items():
            self._transmissions.actuators[name].position = position
        return True

    def read(self, time_s, period_s):
        self._transmissions.propagate_states()

    def write(self, time_s, period_s):
        self._guard.enforce(period_s)
        self._transmissions.propagate_commands()
        for motor in self._transmissions.actuators.values():
            if math.isfinite(motor.command_position):
                motor.position = motor.command_position
"""
INTERFACE = "<hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface>"
WRIST = f"""  <transmission name="wrist"><type>transmission_interface/DifferentialTransmission</type>
    <joint name="pitch"><role>joint1</role>{INTERFACE}</joint>
    <joint name="roll"><role>joint2</role><mechanicalReduction>2</mechanicalReduction>{INTERFACE}</joint>
    <actuator name="m1"><role>actuator1</role><mechanicalReduction>50</mechanicalReduction></actuator>
    <actuator name="m2"><role>actuator2</role><mechanicalReduction>-50</mechanicalReduction></actuator>
  </transmission>"""
ELBOW = f"""  <transmission name="elbow"><type>transmission_interface/SimpleTransmission</type>
    <joint name="elbow"><offset>0.1</offset>{INTERFACE}</joint>
    <actuator name="m3"><mechanicalReduction>100</mechanicalReduction></actuator>
  </transmission>"""
ROBOT = f"""<robot name="r">
  <joint name="pitch" type="revolute"><limit lower="-1" upper="1" velocity="100" effort="1"/></joint>
{WRIST}
{ELBOW}
</robot>"""
LAUNCH = """
<launch>
  <env name="ROS_PACKAGE_PATH" value="{folder}:$(env ROS_PACKAGE_PATH)"/>
  <env name="PYTHONPATH" value="{folder}:$(env PYTHONPATH)"/>
  <param name="robot_description" value={good}/>
  <param name="faulty/robot_description" value={faulty}/>
  <rosparam>
    states: {{type: joint_state_controller/JointStateController, publish_rate: 1000}}
    arm: {{type: position_controllers/JointGroupPositionController, joints: [pitch, roll, elbow]}}
  </rosparam>
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen">
    <param name="type" value="lab_motors/Motors"/>
  </node>
  <node ns="faulty" pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen">
    <param name="type" value="lab_motors/Motors"/>
  </node>
</launch>
"""


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


@pytest.fixture(scope="module", autouse=True)
def robot(ros_launch: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("lab_motors")
    (folder / "lab_motors_hw.py").write_text(MODULE)
    (folder / "package.xml").write_text(
        '<package format="3"><name>lab_motors</name><version>0.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">a</maintainer><license>BSD-3-Clause</license>'
        '<export><modular_framework_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    (folder / "plugins.xml").write_text(
        '<library path="lab_motors_hw"><class name="lab_motors/Motors" type="Motors" '
        'base_class_type="hardware_interface::RobotHW"/></library>'
    )
    faulty = ROBOT.replace("actuator2", "actuator1").replace(">100<", ">0<")
    session = ros_launch(LAUNCH.format(folder=folder, good=quoteattr(ROBOT), faulty=quoteattr(faulty)))
    for name in ("states", "arm"):
        assert call("load_controller", LoadController, name).ok, name
    assert call("switch_controller", SwitchController, ["states", "arm"], [], 2, False, 0.0).ok
    return session


def test_joints_go_where_they_are_commanded_through_their_motors() -> None:
    seen: list[dict[str, float]] = []
    subscriber = rospy.Subscriber(
        "joint_states", JointState, lambda heard: seen.append(dict(zip(heard.name, heard.position, strict=True)))
    )
    until(lambda: seen, "a joint state")
    assert seen[0] == pytest.approx({"pitch": 0.0, "roll": 0.0, "elbow": 0.3}), "where the motors stand"
    command = rospy.Publisher("arm/command", Float64MultiArray, queue_size=1)
    until(command.get_num_connections, "arm/command has a subscriber")
    command.publish(Float64MultiArray(data=[5.0, 0.4, -0.2]))
    wanted = {"pitch": 1.0, "roll": 0.4, "elbow": -0.2}  # the pitch as far as its limit
    until(lambda: seen[-1] == pytest.approx(wanted, abs=1e-9), "the joints where they are commanded")
    subscriber.unregister()


def test_a_description_with_faulty_transmissions_ends_the_node_with_each_fault_and_its_line(robot: Any) -> None:
    reason = (
        "robot_description:6: transmission 'wrist': the roles of its <actuator> are 'actuator1', 'actuator1'; "
        "expected <role>actuator1</role> in one and <role>actuator2</role> in the other; "
        "robot_description:11: transmission 'elbow': <mechanicalReduction> of actuator 'm3' is '0'; expected a "
        "number other than 0"
    )
    until(lambda: reason in robot.log(), "the reason in the log")
    assert "Traceback" not in robot.log()
