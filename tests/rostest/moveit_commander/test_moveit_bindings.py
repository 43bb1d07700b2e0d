# SPDX-License-Identifier: BSD-3-Clause
"""The public names of MoveIt's Python bindings: messages as bytes, poses as lists, refused targets as False."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moveit_commander
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_commander.conversions import list_to_pose, msg_to_string
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    Grasp,
    MotionPlanRequest,
    MoveItErrorCodes,
    PlaceLocation,
    PlannerInterfaceDescription,
    PlanningScene,
    PlanningSceneComponents,
    RobotState,
    RobotTrajectory,
    TrajectoryConstraints,
)
from moveit_ros_planning_interface._moveit_move_group_interface import SAME, MoveGroupInterface
from moveit_ros_planning_interface._moveit_planning_scene_interface import PlanningSceneInterface
from moveit_ros_planning_interface._moveit_robot_interface import RobotInterface
from moveit_ros_planning_interface._moveit_roscpp_initializer import roscpp_init, roscpp_shutdown
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
ARM_JOINTS = [f"panda_joint{number}" for number in range(1, 8)]


@pytest.fixture(scope="module", autouse=True)
def session(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[Any]:
    session = ros_launch(user_packages / "panda_moveit_config" / "launch" / "demo.launch", use_rviz="false")
    session.wait_for_service("plan_kinematic_path", 120.0)
    roscpp_init("my_script", ["test"])
    yield session
    assert session.alive(), session.log()
    roscpp_shutdown()


@pytest.fixture(scope="module")
def group(session: Any) -> MoveGroupInterface:
    group = MoveGroupInterface("panda_arm", "robot_description", "", 30.0)
    group.set_max_velocity_scaling_factor(1.0)
    group.set_max_acceleration_scaling_factor(1.0)
    return group


@pytest.fixture(scope="module")
def robot(session: Any) -> RobotInterface:
    return RobotInterface("robot_description")


@pytest.fixture(scope="module")
def scene(session: Any) -> PlanningSceneInterface:
    return PlanningSceneInterface()


def read(kind: Any, data: bytes) -> Any:
    assert isinstance(data, bytes)
    return kind().deserialize(data)


def test_every_method_taken_over_is_one_of_the_commander(group: MoveGroupInterface) -> None:
    assert not [name for name in SAME if not callable(getattr(moveit_commander.MoveGroupCommander, name, None))]
    assert set(SAME) <= set(dir(group)) and group.get_name() == "panda_arm"
    with pytest.raises(AttributeError, match="set_scene"):
        _ = group.set_scene
    with pytest.raises(RuntimeError, match="nobody"):
        MoveGroupInterface("nobody", "robot_description")


def test_states_and_descriptions_are_bytes(group: MoveGroupInterface) -> None:
    assert group.get_variables() == ARM_JOINTS and group.start_state_monitor(10.0)
    assert read(PlannerInterfaceDescription, group.get_interface_description()).planner_ids
    state = read(RobotState, group.get_current_state())
    assert set(ARM_JOINTS) <= set(state.joint_state.name)
    assert group.get_current_state_bounded()["panda_joint4"] == pytest.approx(READY[3], abs=1e-3)
    state.joint_state.position = [100.0] * len(state.joint_state.name)
    assert max(read(RobotState, group.enforce_bounds(msg_to_string(state))).joint_state.position) < 100.0
    assert group.get_current_pose()[:3] == pytest.approx([0.307, 0.0, 0.59], abs=2e-3)
    assert len(group.get_random_pose("panda_link8")) == 7
    with pytest.raises(TypeError, match="Python argument types in.*serialized moveit_msgs/RobotState"):
        group.enforce_bounds("text")


def test_a_refused_target_is_false_and_leaves_the_one_before(group: MoveGroupInterface) -> None:
    assert group.set_joint_value_target(np.array(READY)) and group.get_joint_value_target() == READY
    assert group.set_joint_value_target({"panda_joint1": 0.1}) and group.set_joint_value_target("panda_joint1", 0.2)
    state = JointState(name=["panda_joint2"], position=[-0.5])
    assert group.set_joint_value_target_from_joint_state_message(msg_to_string(state))
    target = group.get_joint_value_target()
    assert target[:2] == [0.2, -0.5]
    for refused in (
        group.set_joint_value_target([9.0] * 7),
        group.set_joint_value_target("elbow", 0.0),
        group.set_named_target("nowhere"),
        group.set_end_effector_link("nowhere"),
        group.set_pose_target([0.0] * 5),
        group.set_path_constraints("nothing"),
    ):
        assert refused is False
    assert group.get_joint_value_target() == target
    here = group.get_current_pose()
    stamped = PoseStamped(pose=list_to_pose(here))
    stamped.header.frame_id = group.get_planning_frame()
    assert group.set_joint_value_target_from_pose(msg_to_string(stamped.pose), "", False)
    assert group.set_joint_value_target_from_pose_stamped(msg_to_string(stamped), "panda_link8", False)
    assert group.set_pose_target(here) and group.set_pose_targets([here, here])
    assert group.set_position_target(*here[:3]) and group.set_orientation_target(*here[3:])
    assert group.set_rpy_target(3.14, 0.0, 0.0)
    assert group.set_named_target("ready")


def test_requests_and_constraints_are_bytes(group: MoveGroupInterface) -> None:
    group.set_workspace(-1.0, -1.0, -1.0, 1.0, 1.0, 1.0)
    group.set_start_state(group.get_current_state())
    group.set_path_constraints_from_msg(msg_to_string(Constraints(name="mine")))
    group.set_trajectory_constraints_from_msg(msg_to_string(TrajectoryConstraints([Constraints(name="ours")])))
    request = read(MotionPlanRequest, group.construct_motion_plan_request())
    assert (request.workspace_parameters.max_corner.z, request.path_constraints.name) == (1.0, "mine")
    assert request.start_state.joint_state.name
    assert read(Constraints, group.get_path_constraints()).name == "mine"
    assert read(TrajectoryConstraints, group.get_trajectory_constraints()).constraints[0].name == "ours"
    group.clear_path_constraints()
    group.clear_trajectory_constraints()
    group.set_start_state_to_current_state()
    group.set_workspace()


def test_plans_are_bytes_and_move_the_arm(group: MoveGroupInterface) -> None:
    assert group.set_joint_value_target("panda_joint1", 0.3)
    code, trajectory, planning_time_s = group.plan()
    assert read(MoveItErrorCodes, code).val == MoveItErrorCodes.SUCCESS and planning_time_s > 0.0
    assert read(RobotTrajectory, trajectory).joint_trajectory.points
    state = group.get_current_state()
    slow = group.retime_trajectory(state, trajectory, 0.5, 0.5, "time_optimal_trajectory_generation")
    assert group.execute(slow) and group.get_current_joint_values()[0] == pytest.approx(0.3, abs=2e-3)
    assert group.execute(trajectory) is False, "the arm is no longer where it begins"
    assert group.set_named_target("ready") and group.move()
    assert group.get_current_joint_values() == pytest.approx(READY, abs=2e-3)
    below = group.get_current_pose()
    below[2] -= 0.05
    path, share = group.compute_cartesian_path([below], 0.01, True)
    assert share == pytest.approx(1.0) and read(RobotTrajectory, path).joint_trajectory.points
    assert group.compute_cartesian_path([below], 0.01, True, msg_to_string(Constraints()))[1] == pytest.approx(1.0)
    assert group.async_execute(path)
    group.stop()
    assert group.set_named_target("ready") and group.async_move()
    group.stop()


def test_what_cannot_be_picked_or_placed_has_a_code(group: MoveGroupInterface) -> None:
    grasp = msg_to_string(Grasp())
    assert group.pick("nothing", grasp) != MoveItErrorCodes.SUCCESS
    assert group.pick("nothing", [grasp], True) != MoveItErrorCodes.SUCCESS
    here = PoseStamped(pose=list_to_pose(group.get_current_pose()))
    here.header.frame_id = group.get_planning_frame()
    assert group.place("nothing", group.get_current_pose()) is False
    assert group.place("nothing", msg_to_string(PlaceLocation(place_pose=here))) is False
    assert group.place("nothing") is False
    assert group.place_poses_list("nothing", [msg_to_string(here)]) is False
    assert group.place_locations_list("nothing", [msg_to_string(PlaceLocation(place_pose=here))]) is False


def test_the_robot(robot: RobotInterface) -> None:
    assert (robot.get_robot_name(), robot.get_robot_root_link()) == ("panda", "panda_link0")
    assert robot.get_planning_frame() and robot.get_group_names() == ["hand", "panda_arm", "panda_arm_hand"]
    assert robot.has_group("hand") and not robot.has_group("nobody")
    assert robot.get_group_active_joint_names("panda_arm") == ARM_JOINTS
    assert set(ARM_JOINTS) <= set(robot.get_active_joint_names()) <= set(robot.get_joint_names())
    assert set(robot.get_group_link_names("hand")) <= set(robot.get_link_names())
    assert set(ARM_JOINTS) <= set(robot.get_group_joint_names("panda_arm"))
    assert robot.get_parent_group("hand") == ("panda_arm", "panda_link8") and robot.get_parent_group("x") == ("", "")
    assert robot.get_group_joint_tips("panda_arm") == ["panda_link8"]
    assert "ready" in robot.get_group_default_states("panda_arm")
    assert robot.get_joint_values("panda_arm", "ready")["panda_joint2"] == -0.785
    assert robot.get_joint_limits("panda_joint1") == [pytest.approx([-2.8973, 2.8973])]
    assert len(robot.get_link_pose("panda_link1")) == 7 and len(robot.get_current_joint_values("panda_joint1")) == 1
    for empty in (
        robot.get_group_joint_names("x"),
        robot.get_group_active_joint_names("x"),
        robot.get_group_link_names("x"),
        robot.get_group_joint_tips("x"),
        robot.get_link_pose("x"),
        robot.get_group_default_states("x"),
        robot.get_joint_limits("x"),
        robot.get_current_joint_values("x"),
    ):
        assert empty == []
    assert robot.get_joint_values("x", "ready") == {}
    state = robot.get_current_state()
    assert robot.get_current_variable_values().keys() >= set(ARM_JOINTS) and read(RobotState, state).joint_state.name
    turned = {"panda_joint1": 0.1}
    for arguments in ((), (state,), (["panda_link3"],), (turned,), (turned, ["panda_hand"])):
        assert read(MarkerArray, robot.get_robot_markers(*arguments)).markers, arguments
    assert read(MarkerArray, robot.get_group_markers("hand")).markers
    assert read(MarkerArray, robot.get_group_markers("hand", {"panda_joint1": 0.1})).markers


def test_the_planning_scene(scene: PlanningSceneInterface) -> None:
    at = PoseStamped(pose=Pose())
    at.header.frame_id, at.pose.position.x, at.pose.orientation.w = "panda_link0", 1.5, 1.0
    box = moveit_commander.PlanningSceneInterface.make_box("box", at, (0.1, 0.1, 0.1))
    change = PlanningScene(is_diff=True)
    change.robot_state.is_diff = True
    change.world.collision_objects = [box]
    assert scene.apply_planning_scene(msg_to_string(change))
    assert scene.get_known_object_names() == ["box"] and scene.get_known_object_names(True) == []
    assert scene.get_known_object_names_in_roi(1.0, -1.0, -1.0, 2.0, 1.0, 1.0) == ["box"]
    assert read(Pose, scene.get_object_poses(["box"])["box"]).position.x == 1.5
    assert read(CollisionObject, scene.get_objects()["box"]).primitives
    change.world.collision_objects = []
    change.robot_state.attached_collision_objects = [AttachedCollisionObject(link_name="panda_hand", object=box)]
    assert scene.apply_planning_scene(msg_to_string(change))
    assert read(AttachedCollisionObject, scene.get_attached_objects(["box"])["box"]).link_name == "panda_hand"
    parts = PlanningSceneComponents.SCENE_SETTINGS
    assert read(PlanningScene, scene.get_planning_scene(parts)).robot_model_name == "panda"
    assert scene.clear() is True and scene.get_attached_objects() == {} and scene.get_known_object_names() == []


def test_the_node_is_the_scripts_own(session: Any) -> None:
    assert rospy.get_name().startswith("/test"), "roscpp_init leaves a node that is there"
