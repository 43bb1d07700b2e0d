# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory controllers that a ROS 2 controller file configures, as a client of their action meets them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from controller_manager_msgs.srv import ListControllers
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.ros_session import RosSession, until

CONTROLLERS = {"absent": "", "zero": "goal_time: 0.0, ", "limited": "goal_time: 0.2, "}
"""Part of the constraints with the goal time, by controller name."""
GAIN, TOLERANCE = 2.0, 0.01
TYPE = "joint_trajectory_controller/JointTrajectoryController"
LAUNCH = """
from launch import LaunchDescription
from launch_ros.actions import Node

def generate_launch_description():
    control = Node(package="controller_manager", executable="ros2_control_node",
                   parameters=[{{"robot_description": {urdf!r}}}, {file!r}], output="screen")
    spawner = Node(package="controller_manager", executable="spawner", arguments={names!r})
    return LaunchDescription([control, spawner])
"""


def file_text() -> str:
    lines = ["controller_manager:", "  ros__parameters:", "    update_rate: 100"]
    lines += [f"    {name}: {{type: {TYPE}}}" for name in CONTROLLERS]
    for name, goal_time in CONTROLLERS.items():
        lines += [
            f"{name}:",
            "  ros__parameters:",
            f"    joints: [joint_{name}]",
            "    command_interfaces: [velocity]",
            "    state_interfaces: [position, velocity]",
            "    interpolation_method: splines",
            "    interpolate_from_desired_state: true",
            f"    gains: {{joint_{name}: {{p: {GAIN}, ff_velocity_scale: 0.0}}}}",
            f"    constraints: {{{goal_time}stopped_velocity_tolerance: 0.1, joint_{name}: {{goal: {TOLERANCE}}}}}",
        ]
    return "\n".join(lines)


@pytest.fixture(scope="module")
def robot(ros_session: RosSession, tmp_path_factory: pytest.TempPathFactory) -> RosSession:
    """Mock joints with velocity commands, and controllers that follow without feed-forward."""
    folder: Path = tmp_path_factory.mktemp("launch")
    (folder / "ros2_controllers.yaml").write_text(file_text())
    links = "".join(f"<link name='link_{name}'/>" for name in CONTROLLERS)
    limit = "<limit lower='-3' upper='3' velocity='9' effort='9'/>"
    joints = "".join(
        f"<joint name='joint_{name}' type='revolute'><parent link='base'/><child link='link_{name}'/>{limit}</joint>"
        for name in CONTROLLERS
    )
    interfaces = "<command_interface name='velocity'/><state_interface name='position'/>"
    hardware = "".join(f"<joint name='joint_{name}'>{interfaces}</joint>" for name in CONTROLLERS)
    plugin = "<hardware><plugin>mock_components/GenericSystem</plugin></hardware>"
    tag = f"<ros2_control name='arm' type='system'>{plugin}{hardware}</ros2_control>"
    urdf = f"<robot name='r'><link name='base'/>{links}{joints}{tag}</robot>"
    path = folder / "control.launch.py"
    path.write_text(LAUNCH.format(urdf=urdf, file=str(folder / "ros2_controllers.yaml"), names=[*CONTROLLERS]))
    ros_session.start(["rosrun", "launch", "launch_py", str(path)])
    ros_session.wait_for_service("controller_manager/list_controllers", 60.0)
    listed = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)

    def run() -> bool:
        controllers = listed().controller
        return len(controllers) == len(CONTROLLERS) and all(each.state == "running" for each in controllers)

    until(run, "all controllers to run")
    return ros_session


Result = tuple[FollowJointTrajectoryResult, int, float]


@pytest.fixture
def follow(robot: RosSession) -> Callable[[str], Result]:
    """Moves a joint by 1 rad within 0.2 s; returns result, status and duration [s]."""

    def moved(name: str) -> Result:
        client = SteadyActionClient(f"{name}/follow_joint_trajectory", FollowJointTrajectoryAction)
        assert client.wait_for_server(rospy.Duration(60.0)), robot.log()
        point = JointTrajectoryPoint(positions=[1.0], velocities=[0.0], time_from_start=rospy.Duration(0.2))
        start = rospy.get_time()
        trajectory = JointTrajectory(joint_names=[f"joint_{name}"], points=[point])
        client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory))
        assert client.wait_for_result(rospy.Duration(30.0))
        return client.get_result(), client.get_state(), rospy.get_time() - start

    return moved


@pytest.mark.parametrize("name", ["absent", "zero"])
def test_without_a_goal_time_a_late_goal_succeeds(name: str, follow: Callable[[str], Result]) -> None:
    """The error decays as exp(-GAIN t): from more than 0.6 rad it is below the tolerance after 2 s."""
    result, status, duration_s = follow(name)
    assert status == GoalStatus.SUCCEEDED, result.error_string
    assert result.error_code == FollowJointTrajectoryResult.SUCCESSFUL
    assert duration_s > 1.5


def test_a_goal_time_ends_a_late_goal(follow: Callable[[str], Result]) -> None:
    result, status, duration_s = follow("limited")
    assert status == GoalStatus.ABORTED
    assert result.error_code == FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED
    assert duration_s < 1.5


def test_every_parameter_of_the_file_is_known_or_converted(follow: Callable[[str], Result], robot: RosSession) -> None:
    follow("zero")
    assert "names no parameter" not in robot.printed_output()
