# SPDX-License-Identifier: BSD-3-Clause
"""A robot whose SRDF has a floating virtual joint: scene changes, states of requests and tf say where it stands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import moveit_commander
import numpy as np
import pytest
import rospy
import tf2_ros
from fake_panda import FAKE_PANDA, fast_panda_arm
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from moveit_commander import MoveGroupCommander, PlanningSceneInterface, RobotCommander
from moveit_msgs.msg import (
    Constraints,
    JointConstraint,
    MotionPlanRequest,
    MoveItErrorCodes,
    PlanningScene,
    PlanningSceneComponents,
    RobotState,
    RobotTrajectory,
)
from moveit_msgs.srv import ApplyPlanningScene, GetMotionPlan, GetPlanningScene, GetPositionFK, GetStateValidity
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectoryPoint
from visualization_msgs.msg import InteractiveMarkerInit

from modular_framework_testing.ros_session import until

MOBILE = '<group name="mobile"><joint name="virtual_joint"/><group name="panda_arm"/></group>'
ROOT, TIP, UPRIGHT = "panda_link0", "panda_link8", Quaternion(0.0, 0.0, 0.0, 1.0)
LAUNCH = f"""<launch>
{FAKE_PANDA}  <param name="robot_description_semantic" value={{srdf}}/>
  <include file="$(find modular_framework_planning)/launch/interactive_goal.launch">
    <arg name="group" value="mobile"/>
  </include>
</launch>"""


@pytest.fixture(scope="module")
def arm(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[MoveGroupCommander]:
    text = (user_packages / "panda_moveit_config/config/panda.srdf").read_text()
    floating = text.replace('name="virtual_joint" type="fixed"', 'name="virtual_joint" type="floating"')
    floating = floating.replace("<end_effector", f"{MOBILE}<end_effector", 1)
    assert floating != text
    session = ros_launch(LAUNCH.format(srdf=quoteattr(floating)))
    commander = fast_panda_arm(session)
    yield commander
    assert session.alive(), session.log()
    moveit_commander.roscpp_shutdown()


def scene() -> Any:
    return rospy.ServiceProxy("get_planning_scene", GetPlanningScene)(PlanningSceneComponents(1023)).scene


def placed(x: float, y: float, z: float, yaw: float) -> RobotState:
    state = RobotState(is_diff=True)
    state.multi_dof_joint_state.joint_names = ["virtual_joint"]
    state.multi_dof_joint_state.transforms = [transform(x, y, z, yaw)]
    return state


def transform(x: float, y: float, z: float, yaw: float) -> Transform:
    return Transform(Vector3(x, y, z), Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)))


def base_of(state: RobotState) -> list[float]:
    """x, y, z and yaw of the base."""
    assert state.multi_dof_joint_state.joint_names == ["virtual_joint"]
    (pose,) = state.multi_dof_joint_state.transforms
    t, q = pose.translation, pose.rotation
    return [t.x, t.y, t.z, 2.0 * math.atan2(q.z, q.w)]


def place(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y, pose.position.z]


def forward_kinematics(state: RobotState, *links: str) -> list[list[float]]:
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(frame_id="world"), list(links), state)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    return [place(stamped.pose) for stamped in answer.pose_stamped]


def is_valid(state: RobotState) -> bool:
    return bool(rospy.ServiceProxy("check_state_validity", GetStateValidity)(state, "panda_arm", Constraints()).valid)


def test_the_planning_frame_is_the_frame_the_base_moves_in(arm: MoveGroupCommander) -> None:
    assert arm.get_planning_frame() == RobotCommander().get_planning_frame() == "world"
    state = scene().robot_state
    assert state.joint_state.header.frame_id == state.multi_dof_joint_state.header.frame_id == "world"
    assert not any("/" in name for name in state.joint_state.name)
    assert base_of(state) == pytest.approx([0.0, 0.0, 0.0, 0.0])


def test_a_change_of_the_scene_places_the_base_and_it_stays_there(arm: MoveGroupCommander) -> None:
    change = PlanningScene(is_diff=True, robot_state=placed(0.5, -1.0, 0.25, 0.5))
    assert rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)(change).success
    assert base_of(scene().robot_state) == pytest.approx([0.5, -1.0, 0.25, 0.5])
    rospy.sleep(0.3)
    assert base_of(scene().robot_state) == pytest.approx([0.5, -1.0, 0.25, 0.5])


def test_the_state_of_a_request_places_the_base_for_that_request_alone(arm: MoveGroupCommander) -> None:
    before = base_of(scene().robot_state)
    here, tip = forward_kinematics(placed(0.0, 0.0, 0.0, 0.0), ROOT, TIP)
    there, moved_tip = forward_kinematics(placed(1.0, 2.0, 3.0, math.pi / 2.0), ROOT, TIP)
    assert here == pytest.approx([0.0, 0.0, 0.0]) and there == pytest.approx([1.0, 2.0, 3.0])
    assert moved_tip == pytest.approx([1.0 - tip[1], 2.0 + tip[0], 3.0 + tip[2]])  # a quarter turn to the left
    assert base_of(scene().robot_state) == pytest.approx(before)


def test_objects_stay_in_the_world_when_the_base_is_elsewhere(arm: MoveGroupCommander) -> None:
    (tip,) = forward_kinematics(placed(0.0, 0.0, 0.0, 0.0), TIP)
    objects = PlanningSceneInterface(synchronous=True)
    objects.add_box("crate", PoseStamped(Header(frame_id="world"), Pose(Point(*tip), UPRIGHT)), (0.1,) * 3)
    assert not is_valid(placed(0.0, 0.0, 0.0, 0.0))
    assert is_valid(placed(3.0, 0.0, 0.0, 0.0))
    objects.clear()


def test_a_plan_starts_where_its_request_puts_the_base(arm: MoveGroupCommander) -> None:
    arm.set_start_state(placed(4.0, 0.0, 0.5, 1.0))
    arm.set_named_target("reaching")
    success, motion, _, _ = arm.plan()
    arm.set_start_state_to_current_state()
    assert success and motion.joint_trajectory.points and not motion.multi_dof_joint_trajectory.points


def test_a_group_with_the_base_is_planned_for_within_the_workspace(arm: MoveGroupCommander) -> None:
    request = MotionPlanRequest(group_name="mobile", start_state=placed(0.0, 0.0, 0.0, 0.0), allowed_planning_time=10.0)
    request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = 1.0
    request.workspace_parameters.header.frame_id = "world"
    request.workspace_parameters.min_corner = Vector3(-1.0, -1.0, 0.0)
    request.workspace_parameters.max_corner = Vector3(3.0, 3.0, 1.0)
    goal = {"trans_x": 2.0, "trans_y": 1.0, "trans_z": 0.5, "rot_x": 0.0, "rot_y": 0.0, "rot_z": 0.6, "rot_w": 0.8}
    joints = [JointConstraint(f"virtual_joint/{name}", value, 0.001, 0.001, 1.0) for name, value in goal.items()]
    joints.append(JointConstraint("panda_joint1", 0.5, 0.001, 0.001, 1.0))
    request.goal_constraints = [Constraints(joint_constraints=joints)]
    plan = rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)
    answer = plan(request).motion_plan_response
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    assert base_of(answer.trajectory_start) == pytest.approx([0.0, 0.0, 0.0, 0.0])
    base = answer.trajectory.multi_dof_joint_trajectory
    assert (base.header.frame_id, base.joint_names) == ("world", ["virtual_joint"])
    end = base.points[-1].transforms[0]
    assert [end.translation.x, end.translation.y, end.translation.z] == pytest.approx([2.0, 1.0, 0.5])
    assert [end.rotation.z, end.rotation.w] == pytest.approx([0.6, 0.8])
    assert answer.trajectory.joint_trajectory.points[-1].positions[0] == pytest.approx(0.5)
    assert base.points[-1].time_from_start == answer.trajectory.joint_trajectory.points[-1].time_from_start
    request.workspace_parameters.max_corner = Vector3(1.5, 3.0, 1.0)
    assert plan(request).motion_plan_response.error_code.val == MoveItErrorCodes.GOAL_STATE_INVALID


def test_the_marker_of_a_floating_base_moves_and_turns_about_every_axis(arm: MoveGroupCommander) -> None:
    shown: list[InteractiveMarkerInit] = []  # the first one has no marker yet
    rospy.Subscriber("/interactive_goal/marker/update_full", InteractiveMarkerInit, shown.append)
    until(lambda: shown and shown[-1].markers, "the markers", 60.0)
    ways = {marker.name: {control.name for control in marker.controls} for marker in shown[-1].markers}
    assert ways["base"] == ways["goal"] == {"menu", *(f"{way}_{axis}" for way in ("move", "rotate") for axis in "xyz")}


def test_a_motion_of_the_base_is_not_executed_here(arm: MoveGroupCommander) -> None:
    motion = RobotTrajectory()
    motion.multi_dof_joint_trajectory.joint_names = ["virtual_joint"]
    motion.multi_dof_joint_trajectory.points = [
        MultiDOFJointTrajectoryPoint(transforms=[transform(1.0, 0.0, 0.0, 0.0)])
    ]
    assert not arm.execute(motion)


def test_the_base_follows_tf_and_the_arm_reaches_poses_in_the_world(arm: MoveGroupCommander) -> None:
    broadcaster, seen = tf2_ros.TransformBroadcaster(), [1.0, 2.0, 0.5, 0.7]
    stamped = TransformStamped(Header(frame_id="world"), ROOT, transform(*seen))

    def send(_event: Any = None) -> None:
        stamped.header.stamp = rospy.Time.now()
        broadcaster.sendTransform(stamped)

    timer = rospy.Timer(rospy.Duration(0.02), send)
    try:
        until(lambda: np.allclose(base_of(scene().robot_state), seen, atol=1e-9), "base in the scene")
        elsewhere = PlanningScene(is_diff=True, robot_state=placed(9.0, 9.0, 9.0, 0.0))
        assert rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)(elsewhere).success
        assert base_of(scene().robot_state) == pytest.approx(seen)  # tf knows better
        (tip,) = forward_kinematics(RobotState(is_diff=True), TIP)
        goal = arm.get_current_pose()
        assert goal.header.frame_id == "world" and place(goal.pose) == pytest.approx(tip, abs=2e-3)
        goal.pose.position.z -= 0.1
        arm.set_pose_target(goal)
        assert arm.go()
        assert place(arm.get_current_pose().pose) == pytest.approx(place(goal.pose), abs=2e-3)
        stamped.transform = transform(1.0, 2.0, 1.5, 0.7)
        until(lambda: math.isclose(base_of(scene().robot_state)[2], 1.5), "base one metre higher")
        (tip,) = forward_kinematics(RobotState(is_diff=True), TIP)
        assert tip[2] == pytest.approx(goal.pose.position.z + 1.0, abs=2e-3)
    finally:
        timer.shutdown()


def test_a_joint_that_is_none_of_the_robots_is_refused(arm: MoveGroupCommander) -> None:
    state = placed(0.0, 0.0, 0.0, 0.0)
    state.multi_dof_joint_state.joint_names = ["wheels"]
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(), [TIP], state)
    assert answer.error_code.val == MoveItErrorCodes.INVALID_ROBOT_STATE
