# SPDX-License-Identifier: BSD-3-Clause
"""move_group runs from what the builder makes of a config package, given to it as private parameters alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rospy
import yaml
from moveit_configs_utils import MoveItConfigs, MoveItConfigsBuilder
from moveit_msgs.msg import Constraints, JointConstraint, MotionPlanRequest, MoveItErrorCodes
from moveit_msgs.srv import GetMotionPlan, GetPositionIK, GetPositionIKRequest, QueryPlannerInterfaces
from sensor_msgs.msg import JointState
from std_msgs.msg import String

JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
START = [0.0, -1.4, 1.2, -1.4, -1.57, 0.0]
GOAL = [0.8, -1.2, 1.0, -1.4, -1.57, 0.5]
NODE = """<launch>
  <rosparam command="load" file="{path}" ns="{name}"/>
  <node pkg="moveit_ros_move_group" type="move_group" name="{name}" output="screen"/>
</launch>"""


@pytest.fixture(scope="module")
def configs() -> MoveItConfigs:
    return (
        MoveItConfigsBuilder("ur5_ezgripper", package_name="ur5_ezgripper_moveit_config")
        .robot_description(mappings={"initial_z": 0.5})
        .planning_pipelines(pipelines=["ompl", "pilz_industrial_motion_planner", "stomp"])
        .planning_scene_monitor(publish_robot_description=True)
        .to_moveit_configs()
    )


@pytest.fixture(scope="module")
def session(ros_launch: Callable[..., Any], configs: MoveItConfigs, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path: Path = tmp_path_factory.mktemp("parameters") / "move_group.yaml"
    path.write_text(yaml.safe_dump(configs.to_dict()))
    session = ros_launch(NODE.format(path=path, name="planner_of_the_arm"))
    session.wait_for_service("plan_kinematic_path", 120.0)
    return session


def plan(pipeline: str = "", planner: str = "") -> Any:
    request = MotionPlanRequest(group_name="arm", pipeline_id=pipeline, planner_id=planner, allowed_planning_time=10.0)
    request.start_state.joint_state.name, request.start_state.joint_state.position = JOINTS, START
    goal = [JointConstraint(joint_name=name, position=at, weight=1.0) for name, at in zip(JOINTS, GOAL, strict=True)]
    request.goal_constraints = [Constraints(joint_constraints=goal)]
    return rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)(request).motion_plan_response


def test_nothing_of_the_robot_is_shared(session: Any) -> None:
    assert not [name for name in rospy.get_param_names() if name.startswith("/robot_description")]


@pytest.mark.parametrize(
    ("pipeline", "planner"), [("", ""), ("pilz_industrial_motion_planner", "PTP"), ("stomp", "STOMP")]
)
def test_each_pipeline_plans(session: Any, pipeline: str, planner: str) -> None:
    answer = plan(pipeline, planner)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    last = dict(
        zip(
            answer.trajectory.joint_trajectory.joint_names,
            answer.trajectory.joint_trajectory.points[-1].positions,
            strict=True,
        )
    )
    assert [last[name] for name in JOINTS] == pytest.approx(GOAL, abs=1e-3)
    assert answer.trajectory.joint_trajectory.points[-1].time_from_start.to_sec() > 0.1


def test_the_default_scaling_of_joint_limits_counts(session: Any) -> None:
    speeds = [abs(speed) for point in plan().trajectory.joint_trajectory.points for speed in point.velocities]
    assert 0.0 < max(speeds) <= 0.1 * 3.2 + 1e-6


def test_the_pipelines_are_those_the_builder_was_asked_for(session: Any) -> None:
    answer = rospy.ServiceProxy("query_planner_interface", QueryPlannerInterfaces)()
    assert {interface.pipeline_id for interface in answer.planner_interfaces} == {
        "ompl",
        "pilz_industrial_motion_planner",
        "stomp",
    }


def test_the_capabilities_of_a_pipeline_are_there(session: Any) -> None:
    session.wait_for_service("plan_sequence_path", 10.0)


def test_kinematics_are_those_of_the_package(session: Any) -> None:
    assert rospy.has_param("/planner_of_the_arm/robot_description_kinematics/arm/kinematics_solver")
    session.wait_for_service("compute_ik", 10.0)
    request = GetPositionIKRequest()
    request.ik_request.group_name = "arm"
    request.ik_request.robot_state.joint_state = JointState(name=JOINTS, position=START)
    request.ik_request.pose_stamped.header.frame_id = "world"
    position = request.ik_request.pose_stamped.pose.position
    position.x, position.y, position.z = 0.4, 0.1, 0.9
    request.ik_request.pose_stamped.pose.orientation.w = 1.0
    answer = rospy.ServiceProxy("compute_ik", GetPositionIK)(request)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS


def test_the_description_is_a_topic_where_the_builder_was_told_so(session: Any, configs: MoveItConfigs) -> None:
    text = rospy.wait_for_message("robot_description", String, timeout=10.0).data
    assert text == configs.robot_description["robot_description"]
    assert not [name for name, _ in rospy.get_published_topics() if name == "/robot_description_semantic"]
