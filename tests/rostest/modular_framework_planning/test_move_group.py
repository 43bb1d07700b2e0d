# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node on the wire: it plans, keeps the scene, executes, cancels, and survives malformed requests."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    MotionPlanRequest,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    PlanningScene,
    PlanningSceneComponents,
    PositionIKRequest,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetPlanningScene,
    GetPositionFK,
    GetPositionIK,
    GetStateValidity,
    QueryPlannerInterfaces,
)
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    GRIPPER,
    GROUP,
    OK,
    START,
    FakeArm,
    add,
    box,
    call,
    joint_goal,
    plan,
    pose_constraints,
    report_of,
    request,
    table,
)
from modular_framework_testing.ros_session import until

pytestmark = pytest.mark.usefixtures("clean_scene")


def test_a_plan_starts_at_the_current_state_and_ends_at_the_pose() -> None:
    add(table())
    answer, report = report_of(lambda: plan(request()))
    assert answer.error_code.val == OK and report["error_code"] == OK and report["request_name"] == "goal"
    points = answer.trajectory.joint_trajectory.points
    assert np.allclose(points[0].positions, START, atol=1e-6)
    stamps = [point.time_from_start.to_sec() for point in points]
    assert all(later > earlier for earlier, later in zip(stamps[:-1], stamps[1:], strict=True))
    state = RobotState(is_diff=True)
    state.joint_state.name, state.joint_state.position = ARM, points[-1].positions
    pose = call("compute_fk", GetPositionFK, Header(frame_id="world"), ["eg_manipulator"], state).pose_stamped[0].pose
    assert np.allclose([pose.position.x, pose.position.y, pose.position.z], [0.1, 0.5, 0.95], atol=1e-5)


def test_a_scene_change_is_in_the_next_answer() -> None:
    add(table())
    assert plan(request()).error_code.val == OK
    add(box("lid", 0.1, 0.5, 0.95, (0.2, 0.2, 0.1)))
    answer, report = report_of(lambda: plan(request()))
    assert answer.error_code.val == MoveItErrorCodes.GOAL_IN_COLLISION
    assert "'lid'" in report["reason"] and "mm deep" in report["reason"]
    add(CollisionObject(id="lid", operation=CollisionObject.REMOVE))
    assert plan(request()).error_code.val == OK


def test_get_planning_scene_answers_what_is_asked_for() -> None:
    add(table())
    parts = PlanningSceneComponents
    names = call("get_planning_scene", GetPlanningScene, parts(parts.WORLD_OBJECT_NAMES)).scene
    assert [item.id for item in names.world.collision_objects] == ["table"]
    assert not names.world.collision_objects[0].primitives and not names.allowed_collision_matrix.entry_names
    full = call("get_planning_scene", GetPlanningScene, parts(1023)).scene
    assert list(full.world.collision_objects[0].primitives[0].dimensions) == [1.2, 0.8, 0.04]
    assert "forearm_link" in full.allowed_collision_matrix.entry_names and full.robot_state.joint_state.name


def test_a_subscriber_gets_the_whole_scene_first_and_then_every_change(arm: FakeArm) -> None:
    add(table())
    heard: list[PlanningScene] = []

    subscriber = rospy.Subscriber("move_group/monitored_planning_scene", PlanningScene, heard.append)
    try:
        until(lambda: heard, "the scene")
        assert not heard[0].is_diff and [item.id for item in heard[0].world.collision_objects] == ["table"]
        assert heard[0].robot_model_name == "ur5_with_ezgripper" and heard[0].robot_state.joint_state.name
        add(box("crate", 0.5, 0.4, 1.5, (0.1, 0.1, 0.1)))
        until(lambda: any(item.id == "crate" for m in heard for item in m.world.collision_objects), "the crate")
        arm.positions[ARM[5]] = 0.5

        def has_the_wrist() -> bool:
            states = [m.robot_state.joint_state for m in heard]
            return any(dict(zip(s.name, s.position, strict=True)).get(ARM[5]) == 0.5 for s in states)

        until(has_the_wrist, "the wrist's new position")
        assert all(message.is_diff for message in heard[1:])
        assert all(m.robot_state.is_diff for m in heard[1:] if m.robot_state.joint_state.name), "held objects stay"
    finally:
        subscriber.unregister()


def test_an_object_of_one_shape_without_a_pose_of_its_own_is_where_its_shape_is() -> None:
    add(box("crate", 0.5, 0.4, 1.5, (0.1, 0.1, 0.1)))
    geometry = PlanningSceneComponents(PlanningSceneComponents.WORLD_OBJECT_GEOMETRY)
    crate = call("get_planning_scene", GetPlanningScene, geometry).scene.world.collision_objects[0]
    assert np.allclose([crate.pose.position.x, crate.pose.position.y, crate.pose.position.z], [0.5, 0.4, 1.5])
    move = CollisionObject(id="crate", operation=CollisionObject.MOVE)
    move.pose = Pose(Point(0, 0, 2), Quaternion(0, 0, 0, 1))
    move.header.frame_id = "world"
    assert add(move)
    crate = call("get_planning_scene", GetPlanningScene, geometry).scene.world.collision_objects[0]
    shape = crate.primitive_poses[0].position
    assert np.allclose([crate.pose.position.x + shape.x, crate.pose.position.z + shape.z], [0.0, 2.0])


def test_attaching_takes_an_object_out_of_the_world_and_detaching_puts_it_back() -> None:
    add(table(), box("block", 0.3, 0.5, 0.90, (0.04, 0.04, 0.08)))
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    attached = AttachedCollisionObject(link_name="ezgripper_palm_link", touch_links=["ezgripper_palm_link"])
    attached.object.id = "block"
    scene.robot_state.attached_collision_objects = [attached]
    assert call("apply_planning_scene", ApplyPlanningScene, scene).success
    state = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    assert [item.id for item in state.world.collision_objects] == ["table"]
    assert [item.object.id for item in state.robot_state.attached_collision_objects] == ["block"]
    attached.object.operation = CollisionObject.REMOVE
    assert call("apply_planning_scene", ApplyPlanningScene, scene).success
    state = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    back = {item.id: item.pose.position for item in state.world.collision_objects}["block"]
    assert np.allclose([back.x, back.y, back.z], [0.3, 0.5, 0.9], atol=1e-6), "the object's frame is where it was"


def test_an_allowed_pair_may_touch() -> None:
    add(table(), box("lid", 0.1, 0.5, 0.95, (0.2, 0.2, 0.1)))
    scene = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    diff = PlanningScene(is_diff=True, allowed_collision_matrix=scene.allowed_collision_matrix)
    diff.allowed_collision_matrix.default_entry_names = ["lid"]
    diff.allowed_collision_matrix.default_entry_values = [True]
    assert call("apply_planning_scene", ApplyPlanningScene, diff).success
    assert plan(request()).error_code.val == OK


def test_state_validity_names_the_bodies_and_the_depth() -> None:
    assert call("check_state_validity", GetStateValidity, RobotState(), GROUP, Constraints()).valid
    add(box("wall", -0.11, 0.46, 1.3, (0.3, 0.3, 0.3)))
    answer = call("check_state_validity", GetStateValidity, RobotState(), GROUP, Constraints())
    assert not answer.valid and answer.contacts[0].depth > 0
    assert "wall" in {answer.contacts[0].contact_body_1, answer.contacts[0].contact_body_2}


def test_state_validity_logs_the_joint_that_is_out_of_bounds() -> None:
    lines: list[str] = []
    log = rospy.Subscriber("/rosout", Log, lambda message: lines.append(message.msg))
    until(lambda: log.get_num_connections() > 0, "the log")
    outside = RobotState(joint_state=JointState(name=[ARM[2]], position=[7.0]), is_diff=True)

    def logged() -> bool:
        assert not call("check_state_validity", GetStateValidity, outside, GROUP, Constraints()).valid
        return any(f"joint {ARM[2]} at 7.0000 is outside" in line for line in lines)

    until(logged, "the joint in the log")
    log.unregister()


def test_planners_are_listed() -> None:
    answer = call("query_planner_interface", QueryPlannerInterfaces)
    assert "RRTConnect" in answer.planner_interfaces[0].planner_ids


def ik(**changes: Any) -> PositionIKRequest:
    message = PositionIKRequest(group_name=GROUP, ik_link_name="eg_manipulator", avoid_collisions=True)
    message.pose_stamped = PoseStamped(Header(frame_id="world"), Pose(Point(0.1, 0.5, 0.95), DOWN))
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_ik_honours_frames_and_says_what_is_out_of_reach() -> None:
    add(table())
    assert call("compute_ik", GetPositionIK, ik()).error_code.val == OK
    on_table = PoseStamped(Header(frame_id="table"), Pose(Point(0.1, -0.06, 0.13), DOWN))
    assert call("compute_ik", GetPositionIK, ik(pose_stamped=on_table)).error_code.val == OK
    far = PoseStamped(Header(frame_id="world"), Pose(Point(0.1, 2.5, 0.95), DOWN))
    answer, report = report_of(lambda: call("compute_ik", GetPositionIK, ik(pose_stamped=far)))
    assert answer.error_code.val == MoveItErrorCodes.NO_IK_SOLUTION and "out of reach" in report["reason"]
    low = PoseStamped(Header(frame_id="world"), Pose(Point(0.1, 0.5, 0.80), DOWN))
    answer, report = report_of(lambda: call("compute_ik", GetPositionIK, ik(pose_stamped=low)))
    assert answer.error_code.val == MoveItErrorCodes.NO_IK_SOLUTION and "'table'" in report["reason"]


NAN = float("nan")
BAD_STATE = RobotState(joint_state=JointState(name=["no_such_joint"], position=[0.0]))
NAN_STATE = RobotState(joint_state=JointState(name=ARM, position=[NAN] * 6))
SHORT_STATE = RobotState(joint_state=JointState(name=ARM, position=[0.0]))
CODES = MoveItErrorCodes


@pytest.mark.parametrize(
    ("message", "codes"),
    [
        (MotionPlanRequest(), {CODES.INVALID_GROUP_NAME}),
        (request(group_name="nobody"), {CODES.INVALID_GROUP_NAME}),
        (request(joint_goal("no_such_joint", 0.0)), {CODES.INVALID_GOAL_CONSTRAINTS}),
        (request(joint_goal("elbow_joint", NAN)), {CODES.INVALID_GOAL_CONSTRAINTS}),
        (request(joint_goal("elbow_joint", 100.0)), {-27}),
        (request(pose_constraints(NAN, 0.5, 0.95)), {CODES.INVALID_GOAL_CONSTRAINTS}),
        (request(pose_constraints(0.1, 0.5, 0.95, frame="nowhere")), {CODES.FRAME_TRANSFORM_FAILURE}),
        (request(Constraints()), {CODES.INVALID_GOAL_CONSTRAINTS}),
        (request(goal_constraints=[]), {CODES.INVALID_GOAL_CONSTRAINTS}),
        (request(start_state=BAD_STATE), {CODES.INVALID_ROBOT_STATE}),
        (request(start_state=NAN_STATE), {CODES.INVALID_ROBOT_STATE}),
        (request(start_state=SHORT_STATE), {CODES.INVALID_ROBOT_STATE}),
        (request(allowed_planning_time=NAN), {CODES.TIMED_OUT}),
        (request(max_velocity_scaling_factor=NAN), {CODES.INVALID_MOTION_PLAN}),
        (request(pipeline_id="nobody"), {CODES.PLANNING_FAILED}),
    ],
)
def test_malformed_plan_requests_get_a_code(message: MotionPlanRequest, codes: set[int]) -> None:
    assert plan(message).error_code.val in codes


def test_malformed_ik_and_fk_requests_get_a_code() -> None:
    zero = PoseStamped(Header(frame_id="world"), Pose())
    lost = PoseStamped(Header(frame_id="nowhere"), Pose(Point(0, 0.5, 1), DOWN))
    for message, code in (
        (PositionIKRequest(), CODES.INVALID_GROUP_NAME),
        (ik(pose_stamped=zero), CODES.FAILURE),
        (ik(pose_stamped=lost), CODES.FRAME_TRANSFORM_FAILURE),
        (ik(ik_link_name="nobody"), CODES.INVALID_LINK_NAME),
        (ik(robot_state=NAN_STATE), CODES.INVALID_ROBOT_STATE),
    ):
        assert call("compute_ik", GetPositionIK, message).error_code.val == code
    for header, links, code in (
        (Header(), ["nobody"], CODES.INVALID_LINK_NAME),
        (Header(), [], CODES.INVALID_LINK_NAME),
        (Header(frame_id="nowhere"), ["tool0"], CODES.FRAME_TRANSFORM_FAILURE),
    ):
        assert call("compute_fk", GetPositionFK, header, links, RobotState()).error_code.val == code


def test_malformed_scenes_are_refused_completely_and_leave_the_scene_alone() -> None:
    bad = [
        box("", 0, 0, 3, (1, 1, 1)),
        box("x", NAN, 0, 3, (1, 1, 1)),
        box("x", 0, 0, 3, (1, -1, 1)),
        box("forearm_link", 0, 0, 3, (1, 1, 1)),
        CollisionObject(id="empty"),
        CollisionObject(id="nobody", operation=CollisionObject.MOVE),
    ]
    for item in bad:
        assert not add(box("good", 0, 0, 3, (0.1, 0.1, 0.1)), item)
    scene = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    assert not scene.world.collision_objects


def execute_client() -> Any:
    client = SteadyActionClient("execute_trajectory", ExecuteTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


def test_a_plan_is_executed_and_the_arm_is_there(arm: FakeArm) -> None:
    answer = plan(request())
    client = execute_client()
    client.send_goal(ExecuteTrajectoryGoal(answer.trajectory))
    assert client.wait_for_result(rospy.Duration(30.0))
    assert client.get_result().error_code.val == OK and client.get_state() == GoalStatus.SUCCEEDED
    end = answer.trajectory.joint_trajectory.points[-1].positions
    assert np.allclose([arm.positions[name] for name in ARM], end, atol=1e-9)


def test_a_cancel_reaches_the_controller_while_the_motion_runs(arm: FakeArm) -> None:
    answer = plan(request(max_velocity_scaling_factor=0.02, max_acceleration_scaling_factor=0.02))
    arm.cancelled.clear()
    client = execute_client()
    client.send_goal(ExecuteTrajectoryGoal(answer.trajectory))
    until(lambda: [arm.positions[name] for name in ARM] != START, "the begin of the motion")
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(20.0))
    assert client.get_result().error_code.val == CODES.PREEMPTED
    assert arm.cancelled.wait(20.0)


def test_a_motion_from_elsewhere_is_refused_with_the_joint_that_is_off(arm: FakeArm) -> None:
    answer = plan(request())
    arm.positions["elbow_joint"] += 0.3
    arm.settle()
    client = execute_client()
    _, report = report_of(
        lambda: client.send_goal_and_wait(ExecuteTrajectoryGoal(answer.trajectory), rospy.Duration(30.0))
    )
    assert client.get_result().error_code.val == CODES.INVALID_MOTION_PLAN
    assert "elbow_joint" in report["reason"] and "allowed_start_tolerance" in report["reason"]


def test_a_controller_that_is_not_there_is_named() -> None:
    goal = ExecuteTrajectoryGoal()
    goal.trajectory.joint_trajectory.joint_names = [GRIPPER]
    goal.trajectory.joint_trajectory.points = [plan(request()).trajectory.joint_trajectory.points[0]]
    goal.trajectory.joint_trajectory.points[0].positions = [0.3]
    client = execute_client()
    _, report = report_of(lambda: client.send_goal_and_wait(goal, rospy.Duration(30.0)))
    assert client.get_result().error_code.val == CODES.CONTROL_FAILED
    assert "ezgripper_controller/gripper_cmd" in report["reason"]


def test_the_move_group_action_plans_and_moves(arm: FakeArm) -> None:
    client = SteadyActionClient("move_group", MoveGroupAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    goal = MoveGroupGoal(request=request())
    goal.planning_options.plan_only = True
    client.send_goal_and_wait(goal, rospy.Duration(30.0))
    assert client.get_result().error_code.val == OK and arm.positions["elbow_joint"] == START[2]
    goal.planning_options.plan_only = False
    client.send_goal_and_wait(goal, rospy.Duration(30.0))
    assert client.get_result().error_code.val == OK
    assert arm.positions["elbow_joint"] != START[2]


def test_several_plans_at_a_time_do_not_disturb_each_other() -> None:
    add(table())
    codes: list[int] = []

    def work(x: float) -> None:
        answer = plan(request(pose_constraints(x, 0.5, 0.95)))
        codes.append(answer.error_code.val)

    threads = [threading.Thread(target=work, args=(0.05 * number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert codes == [OK] * 4
