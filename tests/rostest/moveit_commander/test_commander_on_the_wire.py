# SPDX-License-Identifier: BSD-3-Clause
"""Every method of moveit_commander, against a running move_group with a controlled (mock) robot."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import actionlib
import moveit_commander
import numpy as np
import pinocchio as pin
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_commander import MoveGroupCommander, MoveItCommanderException, PlanningSceneInterface, RobotCommander
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    ExecuteTrajectoryAction,
    MoveGroupAction,
    MoveItErrorCodes,
    OrientationConstraint,
    RobotState,
    RobotTrajectory,
    TrajectoryConstraints,
)
from moveit_msgs.srv import GetPositionFK
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_testing.ros_session import until

START = {
    "shoulder_pan_joint": 1.57,
    "shoulder_lift_joint": -1.57,
    "elbow_joint": 1.2,
    "wrist_1_joint": -1.2,
    "wrist_2_joint": -1.57,
    "wrist_3_joint": 0.0,
}
FINGER = "ezgripper_knuckle_palm_L1_1"
PALM = "ezgripper_palm_link"
DOWN = Quaternion(1.0, 0.0, 0.0, 0.0)
GOAL = Pose(Point(0.1, 0.5, 0.95), DOWN)
NEAR = [1.5, -1.5, 1.3, -1.3, -1.5, 0.1]


@pytest.fixture(scope="module", autouse=True)
def session(ros_session: Any) -> Iterator[Any]:
    ros_session.wait_for_service("plan_kinematic_path", 120.0)
    moveit_commander.roscpp_initialize(["test", "__name:=ignored"])
    yield ros_session
    assert ros_session.answers("/move_group"), ros_session.log()
    moveit_commander.roscpp_shutdown()


def pose_of(link: str, state: RobotState) -> PoseStamped:
    """Where a link is in a state of the robot."""
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(), [link], state)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    return answer.pose_stamped[0]


@pytest.fixture(scope="module")
def robot(session: Any) -> RobotCommander:
    robot = RobotCommander()
    until(
        lambda: len(rospy.wait_for_message("joint_states", JointState, 30.0).name) >= 7,
        "joint states of the arm and the gripper",
    )
    return robot


@pytest.fixture(scope="module")
def arm(robot: RobotCommander) -> MoveGroupCommander:
    arm = MoveGroupCommander("arm_and_manipulator", wait_for_servers=30.0)
    arm.set_max_velocity_scaling_factor(1.0)
    arm.set_max_acceleration_scaling_factor(1.0)
    return arm


def stamped(x: float, y: float, z: float, frame: str = "world") -> PoseStamped:
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), Quaternion(0, 0, 0, 1)))


def place_of(pose: PoseStamped) -> list[float]:
    return moveit_commander.conversions.pose_to_list(pose.pose)


def is_at(arm: MoveGroupCommander, values: Any) -> bool:
    return np.allclose(arm.get_current_joint_values(), values, atol=2e-3)


# ---------------------------------------------------------------- RobotCommander
def test_the_robot_is_described(robot: RobotCommander) -> None:
    assert robot.get_planning_frame() == robot.get_root_link() == "world"
    assert robot.get_robot_name() == "ur5_with_ezgripper"
    assert {"arm", "arm_and_manipulator", "ezgripper"} <= set(robot.get_group_names())
    assert robot.has_group("arm") and not robot.has_group("leg")
    assert robot.get_active_joint_names() == [*START, FINGER]
    assert robot.get_active_joint_names("arm") == list(START)
    assert set(robot.get_active_joint_names()) < set(robot.get_joint_names())
    assert set(START) < set(robot.get_joint_names("arm_and_manipulator"))
    assert "forearm_link" in robot.get_link_names() and "forearm_link" not in robot.get_link_names("ezgripper")
    assert robot.get_default_owner_group("elbow_joint") == "arm"
    assert robot.get_default_owner_group("no_such_joint") is None
    for ask in (robot.get_active_joint_names, robot.get_joint_names, robot.get_link_names, robot.get_group):
        with pytest.raises(MoveItCommanderException, match="There is no group named"):
            ask("leg")


def test_the_robot_knows_its_state(robot: RobotCommander) -> None:
    state = robot.get_current_state().joint_state
    known = dict(zip(state.name, state.position, strict=True))
    assert {name: known[name] for name in START} == pytest.approx(START, abs=1e-6)
    values = robot.get_current_variable_values()
    assert values == pytest.approx(known, abs=1e-6)
    assert values["ezgripper_knuckle_palm_L1_2"] == pytest.approx(values[FINGER]), "mimic joints follow"


def test_joints_and_links_answer_for_themselves(robot: RobotCommander) -> None:
    joint = robot.get_joint("elbow_joint")
    assert joint.name() == "elbow_joint" and joint.variable_count() == 1
    assert joint.bounds() == [joint.min_bound(), joint.max_bound()] and joint.min_bound() < 0.0 < joint.max_bound()
    assert joint.value() == pytest.approx(START["elbow_joint"])
    assert robot.world_joint.bounds() == robot.world_joint.value() == [] and robot.world_joint.variable_count() == 0
    link = robot.get_link("base_link")
    assert link.name() == "base_link" and link.pose().header.frame_id == "world"
    assert place_of(link.pose())[:3] == pytest.approx([0.0, 0.0, 0.86], abs=1e-6)
    assert robot.elbow_joint.name() == "elbow_joint" and robot.base_link.name() == "base_link"
    assert robot.arm is robot.get_group("arm") and robot.arm.get_name() == "arm"
    for ask in (robot.get_joint, robot.get_link):
        with pytest.raises(MoveItCommanderException, match="nobody"):
            ask("nobody")
    with pytest.raises(AttributeError, match="nobody"):
        _ = robot.nobody


def test_markers_show_the_robot(robot: RobotCommander) -> None:
    links = {marker.ns for marker in robot.get_robot_markers().markers}
    assert {"forearm_link", "upper_arm_link"} <= links
    turned = robot.get_robot_markers({"shoulder_pan_joint": 0.0}, ["forearm_link"]).markers
    now = robot.get_robot_markers(robot.get_current_state()).markers
    here = next(marker for marker in now if marker.ns == "forearm_link")
    assert {marker.ns for marker in turned} == {"forearm_link"} and turned[0].pose != here.pose
    assert {marker.ns for marker in robot.get_robot_markers("ezgripper").markers} <= links
    assert robot.get_robot_markers("arm", {"elbow_joint": 0.0}).markers
    assert robot.get_robot_markers({"elbow_joint": 0.0}).markers
    with pytest.raises(MoveItCommanderException, match="Unexpected type"):
        robot.get_robot_markers(3.0)


# ---------------------------------------------------------------- MoveGroupCommander: what it knows
def test_the_group_is_described(arm: MoveGroupCommander) -> None:
    assert arm.get_name() == "arm_and_manipulator" and arm.get_planning_frame() == "world"
    assert arm.get_active_joints() == list(START) and set(START) < set(arm.get_joints())
    assert arm.get_variable_count() == 6
    assert arm.has_end_effector_link() and arm.get_end_effector_link() == "eg_manipulator"
    arm.set_end_effector_link("tool0")
    assert arm.get_end_effector_link() == "tool0"
    arm.set_end_effector_link("eg_manipulator")
    with pytest.raises(MoveItCommanderException, match="Unable to set end effector link"):
        arm.set_end_effector_link("nobody")
    assert arm.get_pose_reference_frame() == "world"
    arm.set_pose_reference_frame("base_link")
    assert arm.get_pose_reference_frame() == "base_link"
    arm.set_pose_reference_frame("world")
    assert "RRTConnect" in arm.get_interface_description().planner_ids


def test_a_group_without_a_tip_needs_a_link(robot: RobotCommander) -> None:
    gripper = robot.get_group("ezgripper")
    assert not gripper.has_end_effector_link() and gripper.get_variable_count() == 4
    assert len(gripper.get_current_joint_values()) == 4
    for ask in (gripper.get_current_pose, gripper.get_current_rpy, gripper.get_random_pose):
        with pytest.raises(MoveItCommanderException, match="There is no end effector"):
            ask()
    assert gripper.get_current_pose(PALM).header.frame_id == "world"


def test_an_unknown_group_or_description_is_a_runtime_error_too() -> None:
    with pytest.raises(RuntimeError, match="There is no group named 'leg'"):
        MoveGroupCommander("leg")
    with pytest.raises(RuntimeError, match="nowhere"):
        RobotCommander("nowhere")
    with pytest.raises(RuntimeError, match="Unable to connect.*Not connected: /elsewhere/move_group/goal, "):
        MoveGroupCommander("arm", ns="elsewhere", wait_for_servers=0.2)


def test_the_current_pose_is_known(arm: MoveGroupCommander) -> None:
    pose = arm.get_current_pose()
    assert pose.header.frame_id == "world" and pose.pose.position.z > 0.86
    turn = moveit_commander.conversions.quaternion_from_rpy(*arm.get_current_rpy())
    assert abs(np.dot(turn, place_of(pose)[3:])) == pytest.approx(1.0, abs=1e-6)
    assert place_of(arm.get_current_pose("base_link"))[:3] == pytest.approx([0.0, 0.0, 0.86], abs=1e-6)
    state = arm.get_current_state()
    assert arm.get_current_state_bounded().joint_state.name == state.joint_state.name
    state.joint_state.position = [100.0] * len(state.joint_state.name)
    assert max(arm.enforce_bounds(state).joint_state.position) < 10.0


def test_random_values_keep_the_bounds(arm: MoveGroupCommander, robot: RobotCommander) -> None:
    for _ in range(20):
        for name, value in zip(arm.get_active_joints(), arm.get_random_joint_values(), strict=True):
            low, high = robot.get_joint(name).bounds()
            assert low <= value <= high
    assert arm.get_random_pose() != arm.get_random_pose()
    arm.set_random_target()
    first = arm.get_joint_value_target()
    arm.set_random_target()
    assert arm.get_joint_value_target() != first


def test_the_jacobian_is_the_slope_of_forward_kinematics(arm: MoveGroupCommander) -> None:
    step, values = 1e-4, list(START.values())
    jacobian = np.array(arm.get_jacobian_matrix(values))
    assert jacobian.shape == (6, 6) and np.array(arm.get_jacobian_matrix(values, [0.0, 0.0, 0.1])).shape == (6, 6)
    for column, name in enumerate(START):
        ends = []
        for shift in (-step, step):
            state = arm.get_current_state()
            state.joint_state.position = [
                value + shift * (key == name)
                for key, value in zip(state.joint_state.name, state.joint_state.position, strict=True)
            ]
            ends.append(place_of(pose_of(arm.get_end_effector_link(), state))[:3])
        slope = (np.array(ends[1]) - ends[0]) / (2.0 * step)
        assert np.allclose(slope, jacobian[:3, column], atol=1e-4), name


# ---------------------------------------------------------------- MoveGroupCommander: settings
def test_settings_are_in_the_request(arm: MoveGroupCommander) -> None:
    other = MoveGroupCommander("arm_and_manipulator")
    assert other.get_goal_tolerance() == (1e-4, 1e-4, 1e-3)
    other.set_goal_tolerance(0.02)
    assert other.get_goal_tolerance() == (0.02, 0.02, 0.02)
    other.set_goal_joint_tolerance(0.001)
    other.set_goal_position_tolerance(0.002)
    other.set_goal_orientation_tolerance(0.003)
    assert (
        other.get_goal_joint_tolerance(),
        other.get_goal_position_tolerance(),
        other.get_goal_orientation_tolerance(),
    ) == (0.001, 0.002, 0.003)
    other.set_planning_time(3.0)
    other.set_planning_time(-1.0)
    assert other.get_planning_time() == 3.0
    other.set_planning_pipeline_id("ompl")
    other.set_planner_id("RRTstar")
    assert (other.get_planning_pipeline_id(), other.get_planner_id()) == ("ompl", "RRTstar")
    other.set_num_planning_attempts(4)
    other.set_max_velocity_scaling_factor(0.5)
    other.set_max_acceleration_scaling_factor(0.25)
    other.limit_max_cartesian_link_speed(0.2)
    other.set_workspace([-1.0, -2.0, 1.0, 2.0])
    other.set_path_constraints(Constraints(name="path"))
    other.set_trajectory_constraints(TrajectoryConstraints([Constraints(name="way")]))
    other.set_start_state(other.get_current_state())
    other.allow_looking(False)
    other.allow_replanning(True)
    other.set_support_surface_name("table")
    request = other.construct_motion_plan_request()
    assert (
        request.group_name,
        request.pipeline_id,
        request.planner_id,
        request.num_planning_attempts,
        request.allowed_planning_time,
    ) == ("arm_and_manipulator", "ompl", "RRTstar", 4, 3.0)
    assert (
        request.max_velocity_scaling_factor,
        request.max_acceleration_scaling_factor,
        request.max_cartesian_speed,
        request.cartesian_speed_limited_link,
    ) == (0.5, 0.25, 0.2, "eg_manipulator")
    assert (request.workspace_parameters.min_corner.y, request.workspace_parameters.max_corner.x) == (-2.0, 1.0)
    assert request.goal_constraints[0].joint_constraints[0].tolerance_above == 0.001
    assert request.path_constraints.name == other.get_path_constraints().name == "path"
    assert other.get_trajectory_constraints() == request.trajectory_constraints
    assert request.start_state.joint_state.name
    other.set_path_constraints(None)
    other.set_trajectory_constraints(None)
    other.clear_path_constraints()
    other.clear_trajectory_constraints()
    other.clear_max_cartesian_link_speed()
    other.set_workspace([])
    other.set_start_state_to_current_state()
    request = other.construct_motion_plan_request()
    assert request.start_state.is_diff and not request.start_state.joint_state.name
    assert request.path_constraints == Constraints() and request.max_cartesian_speed == 0.0
    assert other.get_known_constraints() == []


def test_settings_out_of_range_are_refused(arm: MoveGroupCommander) -> None:
    for wrong in (0.0, -0.1, 1.1, math.nan):
        for setter in (arm.set_max_velocity_scaling_factor, arm.set_max_acceleration_scaling_factor):
            with pytest.raises(MoveItCommanderException, match="Expected value in the range from 0 to 1"):
                setter(wrong)
    for setter, wrong in (
        (arm.limit_max_cartesian_link_speed, 0.0),
        (arm.set_workspace, [1.0]),
        (arm.set_path_constraints, "upright"),
        (arm.set_trajectory_constraints, "upright"),
    ):
        with pytest.raises(MoveItCommanderException):
            setter(wrong)
    with pytest.raises(MoveItCommanderException, match="database"):
        arm.set_constraints_database("localhost", 33829)


# ---------------------------------------------------------------- MoveGroupCommander: targets
def test_joint_targets_have_many_forms(arm: MoveGroupCommander) -> None:
    arm.set_joint_value_target(NEAR)
    assert arm.get_joint_value_target() == NEAR
    arm.set_joint_value_target({"elbow_joint": 1.0})
    arm.set_joint_value_target("wrist_3_joint", 0.5)
    arm.set_joint_value_target("wrist_2_joint", [-1.0])
    arm.set_joint_value_target(JointState(name=["wrist_1_joint"], position=[-0.9]))
    assert arm.get_joint_value_target() == [1.5, -1.5, 1.0, -0.9, -1.0, 0.5]
    for arguments in (
        ([1.0],),
        ({"nobody": 1.0},),
        ("elbow_joint",),
        ("elbow_joint", 100.0),
        ("elbow_joint", [1, 2]),
        ("elbow_joint", 1.0, 2.0),
        (NEAR, 1.0),
        (3.5,),
        (GOAL, 3.5),
        ([math.nan] * 6,),
        (JointState(name=["elbow_joint"]),),
        (stamped(0.0, 5.0, 0.0),),
    ):
        with pytest.raises(MoveItCommanderException):
            arm.set_joint_value_target(*arguments)
    assert arm.get_joint_value_target() == [1.5, -1.5, 1.0, -0.9, -1.0, 0.5], "a refused target changes nothing"
    arm.set_joint_value_target(stamped(0.0, 5.0, 0.0), True)
    assert arm.get_joint_value_target() != [1.5, -1.5, 1.0, -0.9, -1.0, 0.5], "an approximate one is as near as it gets"


def test_a_pose_becomes_joint_values(arm: MoveGroupCommander) -> None:
    for arguments in ((GOAL,), (PoseStamped(Header(frame_id="world"), GOAL), "eg_manipulator", True)):
        arm.set_joint_value_target(*arguments)
        values = arm.get_joint_value_target()
        state = arm.get_current_state()
        found = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
        found.update(zip(arm.get_active_joints(), values, strict=True))
        state.joint_state.name, state.joint_state.position = list(found), list(found.values())
        assert place_of(pose_of(arm.get_end_effector_link(), state))[:3] == pytest.approx([0.1, 0.5, 0.95], abs=1e-4)


def test_named_and_remembered_targets(arm: MoveGroupCommander) -> None:
    assert {"initial_pose", "stability_pose"} <= set(arm.get_named_targets())
    values = arm.get_named_target_values("stability_pose")
    arm.set_named_target("stability_pose")
    assert dict(zip(START, arm.get_joint_value_target(), strict=True)) == pytest.approx(values)
    arm.remember_joint_values("near", NEAR)
    arm.remember_joint_values("here")
    assert arm.get_remembered_joint_values()["near"] == NEAR
    assert arm.get_remembered_joint_values()["here"] == pytest.approx(list(START.values()), abs=1e-6)
    arm.set_named_target("near")
    assert arm.get_joint_value_target() == NEAR
    arm.forget_joint_values("near")
    with pytest.raises(MoveItCommanderException, match="Unable to set target near"):
        arm.set_named_target("near")


def test_pose_targets_are_constraints(arm: MoveGroupCommander) -> None:
    def goals() -> Any:
        return arm.construct_motion_plan_request().goal_constraints

    arm.set_pose_target(PoseStamped(Header(frame_id="base_link"), GOAL))
    assert goals()[0].position_constraints[0].header.frame_id == "base_link"
    arm.set_pose_target([0.1, 0.5, 0.95, math.pi, 0.0, 0.0], "tool0")
    assert {item.link_name for item in goals()[0].position_constraints} == {"eg_manipulator", "tool0"}
    arm.clear_pose_target("tool0")
    arm.set_pose_targets([GOAL, [0.0, 0.5, 0.95, 1.0, 0.0, 0.0, 0.0]])
    assert [goal.position_constraints[0].link_name for goal in goals()] == ["eg_manipulator"] * 2
    arm.set_position_target([0.1, 0.5, 0.95])
    assert goals()[0].position_constraints and not goals()[0].orientation_constraints
    for setter, value in ((arm.set_orientation_target, [1.0, 0.0, 0.0, 0.0]), (arm.set_rpy_target, [math.pi, 0, 0])):
        setter(value)
        assert not goals()[0].position_constraints
        assert abs(goals()[0].orientation_constraints[0].orientation.x) == pytest.approx(1.0)
    arm.shift_pose_target(2, 0.05)
    lifted = goals()[0].position_constraints[0].constraint_region.primitive_poses[0].position
    assert lifted.z == pytest.approx(arm.get_current_pose().pose.position.z + 0.05, abs=1e-5)
    arm.shift_pose_target(5, 0.1)
    for setter, value in (
        (arm.set_orientation_target, [1.0]),
        (arm.set_rpy_target, [1.0]),
        (arm.set_pose_target, [1]),
        (arm.set_position_target, [1.0]),
        (arm.set_pose_targets, []),
    ):
        with pytest.raises(MoveItCommanderException):
            setter(value)
    with pytest.raises(MoveItCommanderException, match="An axis value between 0 and 5"):
        arm.shift_pose_target(6, 0.1)
    arm.clear_pose_targets()
    assert goals() == []


# ---------------------------------------------------------------- MoveGroupCommander: plan and move
def test_a_plan_is_a_tuple_of_four_and_can_be_executed(arm: MoveGroupCommander) -> None:
    success, trajectory, planning_time, code = arm.plan(NEAR)
    assert success is True and isinstance(trajectory, RobotTrajectory) and code.val == MoveItErrorCodes.SUCCESS
    assert planning_time > 0.0
    assert trajectory.joint_trajectory.points[-1].positions == pytest.approx(NEAR, abs=1e-3)
    slow = arm.retime_trajectory(arm.get_current_state(), trajectory, 0.5, 0.5)
    ends = [item.joint_trajectory.points[-1].time_from_start.to_sec() for item in (trajectory, slow)]
    assert ends[1] > ends[0] and slow.joint_trajectory.points[-1].positions == pytest.approx(NEAR, abs=1e-3)
    for name in ("magic", ""):
        assert not arm.retime_trajectory(arm.get_current_state(), trajectory, algorithm=name).joint_trajectory.points
    for name, wrong in (
        ("ref_state_in", (None, trajectory)),
        ("traj_in", (arm.get_current_state(), trajectory.joint_trajectory)),
        ("velocity_scaling_factor", (arm.get_current_state(), trajectory, "0.5")),
        ("algorithm", (arm.get_current_state(), trajectory, 0.5, 0.5, None)),
    ):
        with pytest.raises(MoveItCommanderException, match=f"retime_trajectory: {name} is a "):
            arm.retime_trajectory(*wrong)
    short = deepcopy(trajectory)
    short.joint_trajectory.points[1].positions = NEAR[1:]
    with pytest.raises(MoveItCommanderException, match=r"points\[1\] has positions .* for each of the 6 joints"):
        arm.retime_trajectory(arm.get_current_state(), short)
    full, beyond = (arm.retime_trajectory(arm.get_current_state(), trajectory, factor, factor) for factor in (1.0, 7.0))
    assert beyond == full, "a factor that is none is 1"
    assert arm.execute(trajectory) is True
    assert is_at(arm, NEAR)
    with pytest.raises(MoveItCommanderException, match="second item"):
        arm.execute((success, trajectory))


def test_go_takes_every_kind_of_target(arm: MoveGroupCommander) -> None:
    assert arm.go(GOAL, wait=True) is True
    assert place_of(arm.get_current_pose())[:3] == pytest.approx([0.1, 0.5, 0.95], abs=2e-3)
    assert arm.go(JointState(name=list(START), position=NEAR)) and is_at(arm, NEAR)
    assert arm.go("here") and is_at(arm, list(START.values()))
    arm.set_joint_value_target(NEAR)
    assert arm.go() and is_at(arm, NEAR)
    assert arm.go(list(START.values()), wait=False) is True
    until(lambda: is_at(arm, list(START.values())), "the arm where it was sent")
    assert arm.plan("here")[0] and arm.plan(GOAL)[0]


def test_a_motion_can_be_stopped_and_not_waited_for(arm: MoveGroupCommander) -> None:
    arm.set_max_velocity_scaling_factor(0.1)
    slow = arm.plan([0.5, *NEAR[1:]])[1]
    arm.set_max_velocity_scaling_factor(1.0)
    assert arm.execute(slow.joint_trajectory, wait=False) is True
    until(lambda: arm.get_current_joint_values()[0] < 1.55, "the motion under way")
    arm.stop()
    places = [arm.get_current_joint_values()]

    def stands_still() -> bool:
        time.sleep(0.2)
        places.append(arm.get_current_joint_values())
        return places[-1] == pytest.approx(places[-2], abs=1e-4)

    until(stands_still, "the arm at rest")  # the controller's ramp to rest takes half a second
    assert places[-1][0] > 0.6
    assert arm.go("here")


STOP = """
import sys
import moveit_commander
moveit_commander.roscpp_initialize(sys.argv)
moveit_commander.MoveGroupCommander("arm_and_manipulator").stop()
"""


def test_a_script_that_only_stops_is_heard(arm: MoveGroupCommander, session: Any) -> None:
    arm.set_max_velocity_scaling_factor(0.02)
    slow = arm.plan([0.5, *NEAR[1:]])[1]
    arm.set_max_velocity_scaling_factor(1.0)
    assert slow.joint_trajectory.points[-1].time_from_start.to_sec() > 15.0
    results: list[bool] = []
    motion = threading.Thread(target=lambda: results.append(arm.execute(slow)))
    motion.start()
    until(lambda: arm.get_current_joint_values()[0] < 1.56, "the motion under way")
    subprocess.run([sys.executable, "-c", STOP], env=session.env, check=True, timeout=60.0)
    motion.join(60.0)
    assert results == [False], "the motion went on to its end"
    assert arm.go("here")


def test_a_plan_that_fails_says_so(arm: MoveGroupCommander) -> None:
    success, trajectory, _, code = arm.plan(Pose(Point(0.0, 3.0, 1.0), DOWN))
    assert success is False and code.val != MoveItErrorCodes.SUCCESS and not trajectory.joint_trajectory.points
    assert arm.go(Pose(Point(0.0, 3.0, 1.0), DOWN)) is False
    lost = RobotTrajectory()
    lost.joint_trajectory.joint_names = ["no_such_joint"]
    lost.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0], time_from_start=rospy.Duration(1))]
    assert arm.execute(lost) is False
    arm.clear_pose_targets()


def test_one_joint_moves_alone(robot: RobotCommander) -> None:
    assert robot.elbow_joint.move(1.25) is True
    assert robot.elbow_joint.value() == pytest.approx(1.25, abs=2e-3)
    assert robot.shoulder_pan_joint.value() == pytest.approx(START["shoulder_pan_joint"], abs=2e-3)
    with pytest.raises(MoveItCommanderException, match="no known group"):
        robot.world_joint.move(0.0)
    assert robot.elbow_joint.move(START["elbow_joint"])


def test_a_straight_line_is_followed_or_the_missing_service_named(arm: MoveGroupCommander) -> None:
    pose = arm.get_current_pose().pose
    pose.position.z += 0.02
    for options in ((), (0.0,), (0.0, True), (True,), (True, Constraints())):
        path, fraction = arm.compute_cartesian_path([pose], 0.01, *options)
        assert fraction == pytest.approx(1.0) and path.joint_trajectory.points
    actions = [
        actionlib.SimpleActionServer(f"nowhere/{name}", kind, lambda _: None, auto_start=False)
        for name, kind in (("move_group", MoveGroupAction), ("execute_trajectory", ExecuteTrajectoryAction))
    ]
    for action in actions:
        action.start()
    lonely = MoveGroupCommander(arm.get_name(), ns="nowhere")
    with pytest.raises(MoveItCommanderException, match="service ./nowhere/compute_cartesian_path. was not advertised"):
        lonely.compute_cartesian_path([pose], 0.01, avoid_collisions=True)
    with pytest.raises(TypeError, match="allowed"):
        arm.compute_cartesian_path([pose], 0.01, 0.0, True, None, 1)
    with pytest.raises(MoveItCommanderException, match="constraint type"):
        arm.compute_cartesian_path([pose], 0.01, path_constraints="upright")


# ---------------------------------------------------------------- MoveGroupCommander: held objects and subframes
def transform(pose: Pose) -> pin.SE3:
    return pin.XYZQUATToSE3(np.array(moveit_commander.conversions.pose_to_list(pose)))


def message(place: pin.SE3) -> Pose:
    return moveit_commander.conversions.list_to_pose(pin.SE3ToXYZQUAT(place).tolist())


TOOL_IN_LINK = Pose(Point(0.0, 0.01, 0.12), Quaternion(math.sin(0.2), 0.0, 0.0, math.cos(0.2)))
TIP_IN_TOOL = Pose(Point(0.0, 0.02, 0.05), Quaternion(0.0, 0.0, math.sin(0.4), math.cos(0.4)))
TIP_IN_LINK = transform(TOOL_IN_LINK) * transform(TIP_IN_TOOL)


@pytest.fixture
def tool(arm: MoveGroupCommander, robot: RobotCommander) -> Iterator[str]:
    """A held tool; yields the name of its subframe."""
    scene = PlanningSceneInterface()
    item = CollisionObject(id="tool", pose=TOOL_IN_LINK, subframe_names=["tip"], subframe_poses=[TIP_IN_TOOL])
    item.header.frame_id = "eg_manipulator"
    item.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.01, 0.01, 0.1])]
    item.primitive_poses = [Pose(orientation=Quaternion(0, 0, 0, 1))]
    touched = [*robot.get_link_names("ezgripper"), PALM]
    scene.attach_object(AttachedCollisionObject("eg_manipulator", item, touched, JointTrajectory(), 0.0))
    yield "tool/tip"
    scene.remove_attached_object("eg_manipulator", "tool")
    scene.remove_world_object("tool")
    arm.set_end_effector_link("eg_manipulator")
    arm.clear_pose_targets()
    arm.clear_path_constraints()


def link_in(trajectory: RobotTrajectory, point: int) -> pin.SE3:
    """Where the link that holds the tool is at a point of a trajectory."""
    path = trajectory.joint_trajectory
    state = RobotState(joint_state=JointState(name=path.joint_names, position=path.points[point].positions))
    state.is_diff = True
    return transform(pose_of("eg_manipulator", state).pose)


def tip_speeds(trajectory: RobotTrajectory) -> np.ndarray:
    """Mean speeds of the tool's tip between the points of a trajectory [m/s]."""
    points = trajectory.joint_trajectory.points
    places = np.array([(link_in(trajectory, index) * TIP_IN_LINK).translation for index in range(len(points))])
    times = np.array([point.time_from_start.to_sec() for point in points])
    return np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)


def test_a_subframe_is_an_end_effector_of_every_call(arm: MoveGroupCommander, tool: str) -> None:
    above = deepcopy(GOAL)
    above.position.z += 0.04
    places = [transform(GOAL), transform(above)]
    assert arm.go(NEAR)
    arm.set_end_effector_link(tool)
    assert arm.get_end_effector_link() == tool
    arm.set_pose_target(message(places[0] * TIP_IN_LINK))
    success, trajectory, _, _ = arm.plan()
    assert success and link_in(trajectory, -1).isApprox(places[0], 2e-3)
    arm.set_end_effector_link("eg_manipulator")
    arm.clear_pose_targets()
    arm.set_pose_target(message(places[0] * TIP_IN_LINK), tool)
    assert arm.go()
    assert transform(arm.get_current_pose("eg_manipulator").pose).isApprox(places[0], 3e-3)
    assert transform(arm.get_current_pose(tool).pose).isApprox(places[0] * TIP_IN_LINK, 3e-3)
    arm.set_joint_value_target(message(places[1] * TIP_IN_LINK), tool)
    success, trajectory, _, _ = arm.plan()
    assert success and link_in(trajectory, -1).isApprox(places[1], 2e-3)
    far = pin.SE3(places[1].rotation, np.array([0.0, 5.0, 1.0]))
    found = []
    for place, link in ((far * TIP_IN_LINK, tool), (far, "eg_manipulator")):
        arm.set_joint_value_target(NEAR)
        arm.set_joint_value_target(message(place), link, True)
        found.append(arm.get_joint_value_target())
    assert found[0] != NEAR and found[0] == pytest.approx(found[1], abs=1e-3), "as near as the link that holds the tool"
    arm.set_end_effector_link(tool)
    arm.limit_max_cartesian_link_speed(0.05)
    turned = pin.SE3(places[0].rotation @ pin.exp3(np.array([0.4, 0.0, 0.0])), places[0].translation)
    trajectory, fraction = arm.compute_cartesian_path([message(turned * TIP_IN_LINK)], 0.01)
    assert fraction == 1.0 and link_in(trajectory, -1).isApprox(turned, 2e-3)
    assert 0.04 < tip_speeds(trajectory).max() <= 0.05 * 1.01, "the link that holds the tool is slower"
    arm.set_pose_target(message(turned * TIP_IN_LINK))
    success, trajectory, _, _ = arm.plan()
    arm.clear_max_cartesian_link_speed()
    assert success and tip_speeds(trajectory).max() <= 0.05 * 1.01


def test_a_subframe_is_kept_within_path_constraints(arm: MoveGroupCommander, tool: str) -> None:
    assert arm.go(NEAR)
    start = transform(arm.get_current_pose("eg_manipulator").pose)
    turn = OrientationConstraint(link_name=tool, weight=1.0)
    turn.header.frame_id = "world"
    turn.orientation = message(start * TIP_IN_LINK).orientation
    turn.absolute_x_axis_tolerance = turn.absolute_y_axis_tolerance = turn.absolute_z_axis_tolerance = 0.3
    arm.set_path_constraints(Constraints(orientation_constraints=[turn]))
    goal = pin.SE3(start.rotation, start.translation + [0.1, 0.0, -0.1])
    arm.set_pose_target(message(goal * TIP_IN_LINK), tool)
    success, trajectory, _, _ = arm.plan()
    assert success and link_in(trajectory, -1).isApprox(goal, 3e-3)
    for point in range(len(trajectory.joint_trajectory.points)):
        turned = pin.log3(start.rotation.T @ link_in(trajectory, point).rotation)
        assert np.linalg.norm(turned) <= math.sqrt(3.0) * 0.31


def test_forward_kinematics_knows_what_is_held(arm: MoveGroupCommander, tool: str) -> None:
    state = RobotState(is_diff=True)
    link = transform(pose_of("eg_manipulator", state).pose)
    assert transform(pose_of("tool", state).pose).isApprox(link * transform(TOOL_IN_LINK), 1e-6)
    assert transform(pose_of(tool, state).pose).isApprox(link * TIP_IN_LINK, 1e-6)
    for name in ("tool/handle", "table/leg", "nobody"):
        with pytest.raises(MoveItCommanderException, match="attached objects and subframes are: tool, tool/tip"):
            arm.set_end_effector_link(name)
        code = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(), [name], state).error_code.val
        assert code == MoveItErrorCodes.INVALID_LINK_NAME


@pytest.mark.parametrize("by_name", [False, True], ids=["attach_box", "attach_object"])
def test_a_held_box_may_overlap_its_touch_links_and_no_others(
    arm: MoveGroupCommander, robot: RobotCommander, by_name: bool
) -> None:
    scene = PlanningSceneInterface()
    place = PoseStamped(Header(frame_id="eg_manipulator"), Pose(orientation=Quaternion(0, 0, 0, 1)))
    hand = [*robot.get_link_names("ezgripper"), PALM]

    def planned_with(touched: list[str]) -> int:
        """The code of a plan with a box that fills the hand."""
        if by_name:
            scene.add_box("box", place, (0.16, 0.16, 0.16))
            arm.attach_object("box", "eg_manipulator", touched)
            until(lambda: "box" in scene.get_attached_objects(), "the box in the hand")
        else:
            scene.attach_box("eg_manipulator", "box", place, (0.16, 0.16, 0.16), touched)
        code = arm.plan(NEAR)[3].val
        scene.remove_attached_object("eg_manipulator", "box")
        scene.remove_world_object("box")
        return int(code)

    assert arm.go(list(START.values()))
    assert planned_with(hand) == MoveItErrorCodes.SUCCESS
    for touched in ([], [name for name in hand if "L1" in name], [PALM]):
        assert planned_with(touched) == MoveItErrorCodes.START_STATE_IN_COLLISION
