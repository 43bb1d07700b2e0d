# SPDX-License-Identifier: BSD-3-Clause
"""The node robot_hw as an operator sees it: its figures, its faults, how it waits for its hardware and how it ends."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from controller_manager_msgs.srv import ListControllers, LoadController, SwitchController
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Empty
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.control.ros_controllers import start_controllers

MODULE = """
import rospy
from std_msgs.msg import String
from modular_framework_control.hardware_interface.handles import ForceTorqueSensorHandle
from modular_framework_control.hardware_interface.interfaces import ForceTorqueSensorInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW

class LabArm(MockRobotHW):
    announces_ready = True
    text = ""

    def init(self, root_nh, robot_hw_nh):
        self.diary = robot_hw_nh.get_param("diary", "")
        rospy.Subscriber(robot_hw_nh.namespace + "/fault", String, self._on_fault)
        self.sensor = ForceTorqueSensorHandle("wrist" + robot_hw_nh.namespace.replace("/", "_"), "tool0")
        sensors = ForceTorqueSensorInterface()
        sensors.register_handle(self.sensor)
        self.register_interface(sensors)
        return super().init(root_nh, robot_hw_nh)

    def _on_fault(self, message):
        self.text = message.data

    def fault(self):
        return self.text

    def read(self, time_s, period_s):
        super().read(time_s, period_s)
        self.sensor.force = (1.0, 2.0, 3.0)

    def write(self, time_s, period_s):
        super().write(time_s, period_s)
        self.last = [handle.command for handle in self._handles]

    def close(self):
        if self.diary:
            with open(self.diary, "w") as file:
                file.write(f"closed at {self.last}")

class LabWheel(LabArm):
    announces_ready = False
"""
LAUNCH = """
<launch>
  <rosparam>
    robot_hardware: [arm_hw, wheel_hw]
    arm_hw: {{type: lab_arm/LabWheel, joints: [shoulder, elbow], topic_to_wait_for: arm_ready}}
    wheel_hw: {{type: lab_arm/LabWheel, joints: [wheel], command_interface: VelocityJointInterface,
               topic_to_wait_for: wheel_ready, diary: {diary}}}
    arm: {{type: position_controllers/JointTrajectoryController, joints: [shoulder, elbow],
          constraints: {{goal_time: 10.0}}}}
    wheel: {{type: velocity_controllers/JointTrajectoryController, joints: [wheel], gains: {{wheel: {{p: 1.0}}}},
            velocity_ff: {{wheel: 1.0}}, constraints: {{goal_time: 10.0}}}}
    wrench: {{type: force_torque_sensor_controller/ForceTorqueSensorController, publish_rate: 20}}
  </rosparam>
  {environment}
  <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen" args="_rate:=125"/>
</launch>
"""
WAITING = """
<launch>
  {environment}
  <node pkg="modular_framework_control" type="robot_hw" name="impatient" output="screen">
    <rosparam>{{type: modular_framework_control/CombinedRobotHW, ready_timeout: 1, robot_hardware: [a, b, c],
      a: {{type: lab_arm/LabArm, joints: [a], topic_to_wait_for: a_ready}},
      b: {{type: lab_arm/LabArm, joints: [b], topic_to_wait_for: b_ready}},
      c: {{type: lab_arm/LabWheel, joints: [c], topic_to_wait_for: c_ready}}}}</rosparam>
  </node>
</launch>
"""
SECOND = """
<launch>
  <group ns="second">
    <rosparam>arm: {type: position_controllers/JointTrajectoryController, joints: [shoulder]}</rosparam>
    <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen">
      <rosparam>{joints: [shoulder]}</rosparam>
    </node>
  </group>
</launch>
"""

EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"
STANDING = f"""
<launch>
  <env name="ROS_PACKAGE_PATH" value="{EXAMPLES}:$(env ROS_PACKAGE_PATH)"/>
  <env name="PYTHONPATH" value="{EXAMPLES}/my_arm/src:$(env PYTHONPATH)"/>
  <group ns="third">
    <rosparam>
      robot_hardware: [my_arm, stray]
      my_arm: {{type: my_arm/MyArm, joints: [bend], start_positions: {{bend: 1.0}}}}
      stray: {{type: modular_framework_control/MockRobotHW, joints: [far], initial_positions: {{far: 2.5}}}}
      joint_limits: {{far: {{has_position_limits: true, min_position: -1.0, max_position: 1.0,
                           has_velocity_limits: true, max_velocity: 1.0}}}}
      states: {{type: joint_state_controller/JointStateController, publish_rate: 50}}
    </rosparam>
    <node pkg="modular_framework_control" type="robot_hw" name="robot_hw" output="screen"/>
  </group>
</launch>
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Settings under which the user's package is found."""
    folder = Path(tmp_path_factory.mktemp("lab_arm"))
    (folder / "lab_arm_hw.py").write_text(MODULE)
    (folder / "package.xml").write_text(
        '<package format="3"><name>lab_arm</name><version>0.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">a</maintainer><license>BSD-3-Clause</license>'
        '<export><modular_framework_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    classes = "".join(
        f'<class name="lab_arm/{name}" type="{name}" base_class_type="hardware_interface::RobotHW"/>'
        for name in ("LabArm", "LabWheel")
    )
    (folder / "plugins.xml").write_text(f'<library path="lab_arm_hw">{classes}</library>')
    return (
        f'<env name="ROS_PACKAGE_PATH" value="{folder}:$(env ROS_PACKAGE_PATH)"/>'
        f'<env name="PYTHONPATH" value="{folder}:$(env PYTHONPATH)"/>'
    )


@pytest.fixture(scope="module")
def diary(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(tmp_path_factory.mktemp("diary")) / "diary.txt"


@pytest.fixture(scope="module")
def robot(ros_launch: Callable[..., Any], environment: str, diary: Path) -> Any:
    session = ros_launch(LAUNCH.format(environment=environment, diary=diary))
    start_controllers(["arm", "wheel", "wrench"])
    return session


def follow(name: str, joints: list[str], positions: list[float], duration_s: float) -> actionlib.SimpleActionClient:
    client = SteadyActionClient(f"{name}/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    point = JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(duration_s))
    client.send_goal(FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=joints, points=[point])))
    deadline = time.monotonic() + 30.0
    while client.get_state() != GoalStatus.ACTIVE:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return client


def figures() -> tuple[int, str, dict[str, str]]:
    (status,) = rospy.wait_for_message("/diagnostics", DiagnosticArray, 30.0).status
    assert status.name == "robot_hw: control loop"
    return status.level, status.message, {value.key: value.value for value in status.values}


def test_the_loop_reports_how_it_keeps_its_time_and_begins_anew_when_asked(robot: Any) -> None:
    time.sleep(1.0)
    _, text, values = figures()
    assert values["rate"] == "125" and int(values["cycles"]) > 50
    assert "cycles overran" in text
    assert 0.0 <= float(values["late_p50_us"]) <= float(values["late_p99_us"]) <= float(values["late_max_us"])
    begun_s = time.monotonic()
    rospy.ServiceProxy("robot_hw/reset_statistics", Empty)()
    assert int(figures()[2]["cycles"]) <= 125.0 * (time.monotonic() - begun_s) + 10


def scheduling(pid: int) -> Iterator[tuple[int, int]]:
    """Priority and policy of each thread of a process."""
    for thread in [int(entry.name) for entry in Path(f"/proc/{pid}/task").iterdir()]:
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            yield os.sched_getparam(thread).sched_priority, os.sched_getscheduler(thread)


def test_the_loop_runs_in_real_time_above_the_node_s_other_threads_where_that_is_permitted(
    robot: Any, real_time_permitted: bool
) -> None:
    granted = sorted(scheduling(rosnode_pid("/robot_hw")))
    if real_time_permitted:
        *others, loop = granted
        assert loop == (80, os.SCHED_FIFO) and others and others[-1] < loop
    else:
        assert set(granted) == {(0, os.SCHED_OTHER)}


HOG = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
end_s = time.monotonic() + 0.4
while time.monotonic() < end_s:
    pass
"""


def test_a_processor_that_something_more_urgent_takes_away_costs_hardly_a_cycle(
    robot: Any, preemption_permitted: bool
) -> None:
    processors = sorted(os.sched_getaffinity(0))
    if len(processors) < 2 or not preemption_permitted:
        pytest.skip("needs two processors and the right to real-time scheduling")
    rospy.ServiceProxy("robot_hw/reset_statistics", Empty)()
    for processor in processors:
        subprocess.run([sys.executable, "-c", HOG, str(processor)], check=True, timeout=30.0)
    values = figures()[2]
    assert int(values["cycles"]) + int(values["missed"]) > 100
    assert int(values["missed"]) < 25, "each processor in turn was away for 50 cycles"
    assert int(values["missed"]) == 0 or float(values["no_processor_max_us"]) >= 8000.0 or int(values["overruns"]) > 0


def test_what_every_controller_claims_is_listed_on_the_wire(robot: Any) -> None:
    listed = {
        entry.name: entry
        for entry in rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)().controller
    }
    claims = {
        name: [(claim.hardware_interface, claim.resources) for claim in entry.claimed_resources]
        for name, entry in listed.items()
    }
    assert claims == {
        "arm": [("hardware_interface::PositionJointInterface", ["shoulder", "elbow"])],
        "wheel": [("hardware_interface::VelocityJointInterface", ["wheel"])],
        "wrench": [("hardware_interface::ForceTorqueSensorInterface", [])],
    }


def test_a_sensor_is_published_under_its_name(robot: Any) -> None:
    message = rospy.wait_for_message("/wrist_arm_hw", WrenchStamped, 30.0)
    assert (message.wrench.force.x, message.wrench.force.z, message.header.frame_id) == (1.0, 3.0, "tool0")


def test_a_fault_of_the_arm_ends_its_goal_and_leaves_the_wheel_alone(robot: Any) -> None:
    switch = rospy.Publisher("/arm_hw/fault", String, queue_size=1)
    arm, wheel = follow("arm", ["shoulder", "elbow"], [1.0, 1.0], 20.0), follow("wheel", ["wheel"], [1.0], 2.0)
    while switch.get_num_connections() == 0:
        time.sleep(0.01)
    switch.publish("protective stop")
    assert arm.wait_for_result(rospy.Duration(15.0)), "long before the 20 s of the motion are over"
    assert arm.get_state() == GoalStatus.ABORTED
    assert "hardware 'arm_hw': protective stop" in arm.get_result().error_string
    assert wheel.wait_for_result(rospy.Duration(30.0)) and wheel.get_state() == GoalStatus.SUCCEEDED
    level, text, values = figures()
    assert level == 2 and values["fault"] == "hardware 'arm_hw': protective stop" and text.startswith("hardware fault")
    switch.publish("")
    again = time.monotonic() + 30.0
    while figures()[2]["fault"]:
        assert time.monotonic() < again
    arm = follow("arm", ["shoulder", "elbow"], [0.2, 0.2], 0.3)
    assert arm.wait_for_result(rospy.Duration(30.0))
    assert arm.get_state() == GoalStatus.SUCCEEDED, arm.get_goal_status_text()


def test_at_its_end_goals_end_velocities_are_0_and_the_hardware_is_closed(robot: Any, diary: Path) -> None:
    wheel = follow("wheel", ["wheel"], [10.0], 20.0)
    pid = rosnode_pid("/robot_hw")
    os.kill(pid, signal.SIGINT)
    assert wheel.wait_for_result(rospy.Duration(15.0))
    assert wheel.get_state() == GoalStatus.PREEMPTED and "stopped" in wheel.get_goal_status_text()
    deadline = time.monotonic() + 30.0
    while Path(f"/proc/{pid}").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert diary.read_text() == "closed at [0.0]"


def rosnode_pid(name: str) -> int:
    _, _, uri = rospy.get_master().lookupNode(name)
    _, _, pid = xmlrpc.client.ServerProxy(uri).getPid("/test")
    return int(pid)


def test_rosnode_kill_ends_goals_like_a_signal(ros_launch: Callable[..., Any]) -> None:
    session = ros_launch(SECOND)
    rospy.wait_for_service("second/controller_manager/load_controller", 60.0)
    assert rospy.ServiceProxy("second/controller_manager/load_controller", LoadController)("arm").ok
    assert rospy.ServiceProxy("second/controller_manager/switch_controller", SwitchController)(
        ["arm"], [], 2, False, 0.0
    ).ok
    arm = follow("second/arm", ["shoulder"], [1.0], 60.0)
    subprocess.run(["rosnode", "kill", "/second/robot_hw"], env=session.env, check=True, timeout=60.0)
    assert arm.wait_for_result(rospy.Duration(30.0)), "the end of the goal is not lost with the node"
    assert arm.get_state() == GoalStatus.PREEMPTED and "stopped" in arm.get_goal_status_text()


def test_every_listed_hardware_that_is_not_ready_in_time_is_named(
    ros_launch: Callable[..., Any], environment: str
) -> None:
    session = ros_launch(WAITING.format(environment=environment))
    expected = "waited 1 s in vain for True on topic /a_ready of hardware 'a', topic /b_ready of hardware 'b';"
    deadline = time.monotonic() + 60.0
    while expected not in session.log():
        assert time.monotonic() < deadline, session.log()
        time.sleep(0.1)


def test_arms_stay_where_they_stand_when_the_node_starts_and_what_is_unusual_is_said(
    ros_launch: Callable[..., Any],
) -> None:
    session = ros_launch(STANDING)
    rospy.wait_for_service("third/controller_manager/load_controller", 60.0)
    assert rospy.ServiceProxy("third/controller_manager/load_controller", LoadController)("states").ok
    switch = rospy.ServiceProxy("third/controller_manager/switch_controller", SwitchController)
    assert switch(["states"], [], 2, False, 0.0).ok
    for _ in range(10):
        message = rospy.wait_for_message("third/joint_states", JointState, 30.0)
        assert dict(zip(message.name, message.position, strict=True)) == {"bend": 1.0, "far": 2.5}
    text = "joint 'far' is held at 2.5, outside its range -1 to 1, until a goal brings it back"
    deadline = time.monotonic() + 30.0
    while True:
        (status,) = rospy.wait_for_message("/diagnostics", DiagnosticArray, 30.0).status
        if status.name == "third/robot_hw: control loop" and text in status.message:
            break
        assert time.monotonic() < deadline, status
    assert status.level == 1 and {value.key: value.value for value in status.values}["outside_limits"] == text
    assert text in session.log()
    assert "no limits in robot_description or joint_limits: velocity and position of joint 'bend'" in session.log()
