# SPDX-License-Identifier: BSD-3-Clause
"""A robot that stands half a metre above the origin of the world: the planning frame is its root, tf has the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moveit_commander
import pytest
import rospy
from fake_panda import FAKE_PANDA, fast_panda_arm
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_commander import MoveGroupCommander, PlanningSceneInterface, RobotCommander
from moveit_msgs.msg import MoveItErrorCodes, PlanningSceneComponents, RobotState
from moveit_msgs.srv import GetPlanningScene, GetPositionFK
from std_msgs.msg import Header

from modular_framework_testing.ros_session import until

ROOT, HEIGHT, UPRIGHT = "panda_link0", 0.5, Quaternion(0.0, 0.0, 0.0, 1.0)
LAUNCH = f"""<launch>
  <node pkg="tf2_ros" type="static_transform_publisher" name="table" args="0 0 {HEIGHT} 0 0 0 world {ROOT}"/>
  <node pkg="tf2_ros" type="static_transform_publisher" name="mast" args="0.3 0.2 2.0 0 0 0 world camera"/>
{FAKE_PANDA}</launch>"""


@pytest.fixture(scope="module")
def arm(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[MoveGroupCommander]:
    session = ros_launch(LAUNCH)
    commander = fast_panda_arm(session)
    until(lambda: {"world", "camera"} <= {item.child_frame_id for item in scene().fixed_frame_transforms}, "tf")
    yield commander
    assert session.alive(), session.log()
    moveit_commander.roscpp_shutdown()


def scene() -> Any:
    return rospy.ServiceProxy("get_planning_scene", GetPlanningScene)(PlanningSceneComponents(1023)).scene


def place(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y, pose.position.z]


def forward_kinematics(frame: str, *links: str) -> Any:
    service = rospy.ServiceProxy("compute_fk", GetPositionFK)
    return service(Header(frame_id=frame), list(links), RobotState(is_diff=True))


def test_the_planning_frame_is_the_root_link(arm: MoveGroupCommander) -> None:
    assert arm.get_planning_frame() == RobotCommander().get_planning_frame() == ROOT
    assert arm.get_pose_reference_frame() == arm.get_current_pose().header.frame_id == ROOT
    assert scene().robot_state.joint_state.header.frame_id == ROOT


def test_forward_kinematics_answers_in_the_frame_that_was_asked_for(arm: MoveGroupCommander) -> None:
    in_world, in_root = (forward_kinematics(frame, ROOT, "panda_link1").pose_stamped for frame in ("world", ""))
    assert [pose.header.frame_id for pose in (in_world[0], in_root[0])] == ["world", ROOT]
    assert place(in_world[0].pose) == pytest.approx([0.0, 0.0, HEIGHT])
    assert place(in_root[0].pose) == pytest.approx([0.0, 0.0, 0.0])
    assert in_world[1].pose.position.z == pytest.approx(in_root[1].pose.position.z + HEIGHT)


def test_an_object_seen_by_the_camera_is_where_the_camera_saw_it(arm: MoveGroupCommander) -> None:
    objects = PlanningSceneInterface(synchronous=True)
    objects.add_box("crate", PoseStamped(Header(frame_id="camera"), Pose(Point(0.1, 0.2, -1.0), UPRIGHT)), (0.1,) * 3)
    objects.add_box("shelf", PoseStamped(Header(frame_id="world"), Pose(Point(1.0, 1.0, 1.0), UPRIGHT)), (0.1,) * 3)
    found = {item.id: item for item in scene().world.collision_objects}
    assert {item.header.frame_id for item in found.values()} == {ROOT}
    assert place(found["crate"].pose) == pytest.approx([0.4, 0.4, 1.0 - HEIGHT])
    assert place(found["shelf"].pose) == pytest.approx([1.0, 1.0, 1.0 - HEIGHT])
    objects.clear()


def test_a_pose_in_the_world_is_reached_where_it_is_in_the_world(arm: MoveGroupCommander) -> None:
    goal = forward_kinematics("world", "panda_link8").pose_stamped[0]
    goal.pose.position.z -= 0.1
    arm.set_pose_target(goal)
    assert arm.go()
    reached = forward_kinematics("world", "panda_link8").pose_stamped[0]
    assert place(reached.pose) == pytest.approx(place(goal.pose), abs=2e-3)
    assert arm.get_current_pose().pose.position.z == pytest.approx(goal.pose.position.z - HEIGHT, abs=2e-3)


def test_an_unknown_frame_is_refused_by_its_name(arm: MoveGroupCommander) -> None:
    answer = forward_kinematics("wrold", ROOT)
    assert answer.error_code.val == MoveItErrorCodes.FRAME_TRANSFORM_FAILURE and not answer.pose_stamped
    arm.set_pose_target(PoseStamped(Header(frame_id="wrold"), Pose(Point(0.4, 0.0, 0.5), UPRIGHT)))
    assert arm.plan()[3].val == MoveItErrorCodes.FRAME_TRANSFORM_FAILURE
