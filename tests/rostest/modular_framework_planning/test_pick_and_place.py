# SPDX-License-Identifier: BSD-3-Clause
"""Pickup and place on the wire: which grasp is taken, what each motion does, and why a grasp cannot be done."""

from __future__ import annotations

from typing import Any

import moveit_commander
import numpy as np
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import (
    Grasp,
    GripperTranslation,
    MoveItErrorCodes,
    PickupAction,
    PickupGoal,
    PlaceAction,
    PlaceGoal,
    PlaceLocation,
    PlanningSceneComponents,
    RobotState,
)
from moveit_msgs.srv import GetPlanningScene, GetPositionFK
from scipy.interpolate import CubicHermiteSpline
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    GRIPPER,
    GROUP,
    OK,
    START,
    FakeArm,
    add,
    box,
    call,
    joint_goal,
    report_of,
    table,
)
from modular_framework_testing.ros_session import until

OPEN, CLOSED = 0.0, 1.2
PALM_TO_BLOCK = 0.155  # from ee_link along its x, which points down in these grasps, to the middle of the block [m]
BLOCK = (0.1, 0.5, 0.90)
EE_DOWN = Quaternion(0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # x of ee_link points down
CODES = MoveItErrorCodes
pytestmark = pytest.mark.move_group(gripper=True)


@pytest.fixture(scope="module")
def pickup(arm: FakeArm) -> Any:
    client = SteadyActionClient("pickup", PickupAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


@pytest.fixture(scope="module")
def place(arm: FakeArm) -> Any:
    client = SteadyActionClient("place", PlaceAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    return client


@pytest.fixture(autouse=True)
def fresh(clean_scene: None) -> None:
    assert add(table(), box("block", *BLOCK, (0.03, 0.03, 0.12)))


def fingers(value: float) -> JointTrajectory:
    return JointTrajectory(joint_names=[GRIPPER], points=[JointTrajectoryPoint(positions=[value])])


def along(x: float, y: float, z: float, desired: float = 0.1, least: float = 0.05, frame: str = "world") -> Any:
    message = GripperTranslation(desired_distance=desired, min_distance=least)
    message.direction.header.frame_id = frame
    message.direction.vector.x, message.direction.vector.y, message.direction.vector.z = x, y, z
    return message


def grasp(
    name: str = "top", quality: float = 1.0, place_of_block: tuple[float, float, float] = BLOCK, **changes: Any
) -> Grasp:
    x, y, z = place_of_block
    message = Grasp(
        id=name,
        grasp_quality=quality,
        pre_grasp_posture=fingers(OPEN),
        grasp_posture=fingers(CLOSED),
        pre_grasp_approach=along(0, 0, -1),
        post_grasp_retreat=along(0, 0, 1),
        grasp_pose=PoseStamped(Header(frame_id="world"), Pose(Point(x, y, z + PALM_TO_BLOCK), EE_DOWN)),
    )
    for key, value in changes.items():
        setattr(message, key, value)
    return message


def pick_goal(*grasps: Grasp, plan_only: bool = True, **changes: Any) -> PickupGoal:
    goal = PickupGoal(
        target_name="block",
        group_name=GROUP,
        possible_grasps=list(grasps) or [grasp()],
        support_surface_name="table",
        allowed_planning_time=10.0,
    )
    goal.planning_options.plan_only = plan_only
    goal.planning_options.planning_scene_diff.is_diff = True
    goal.planning_options.planning_scene_diff.robot_state.is_diff = True
    for key, value in changes.items():
        setattr(goal, key, value)
    return goal


def place_goal(plan_only: bool = True, **changes: Any) -> PlaceGoal:
    location = PlaceLocation(
        id="left",
        pre_place_approach=along(0, 0, -1),
        post_place_retreat=along(0, 0, 1),
        post_place_posture=fingers(OPEN),
    )
    location.place_pose = PoseStamped(Header(frame_id="world"), Pose(Point(-0.15, 0.5, 0.9005), Quaternion(0, 0, 0, 1)))
    goal = PlaceGoal(
        group_name=GROUP,
        attached_object_name="block",
        place_locations=[location],
        support_surface_name="table",
        allowed_planning_time=10.0,
    )
    goal.planning_options.plan_only = plan_only
    for key, value in changes.items():
        setattr(goal, key, value)
    return goal


def ask(client: Any, goal: Any) -> tuple[Any, dict[str, Any]]:
    """The result, and the last report of pickup or place."""

    def work() -> Any:
        client.send_goal(goal)
        assert client.wait_for_result(rospy.Duration(90.0)), "no result"
        return client.get_result()

    return report_of(work, "pickup", "place")


def scene() -> Any:
    return call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene


def held() -> list[str]:
    return [item.object.id for item in scene().robot_state.attached_collision_objects]


def places_of(trajectory: Any) -> list[tuple[float, float, float]]:
    """Places of ee_link at the start, in the middle and at the end of the motion."""
    result, points = [], trajectory.joint_trajectory.points
    for point in (points[0], points[len(points) // 2], points[-1]):
        state = RobotState(is_diff=True)
        state.joint_state.name, state.joint_state.position = ARM, point.positions
        pose = call("compute_fk", GetPositionFK, Header(frame_id="world"), ["ee_link"], state).pose_stamped[0].pose
        result.append((pose.position.x, pose.position.y, pose.position.z))
    return result


def test_a_planned_pick_has_all_its_stages_and_moves_nothing(pickup: Any, arm: FakeArm) -> None:
    result, report = ask(pickup, pick_goal())
    assert result.error_code.val == OK, report
    assert result.trajectory_descriptions == ["plan", "pre_grasp", "approach", "grasp", "retreat"]
    assert len(result.trajectory_stages) == 5 and result.grasp.id == "top" and result.planning_time > 0.0
    assert report["kind"] == "pickup" and report["stages"] == result.trajectory_descriptions
    joints = [list(item.joint_trajectory.joint_names) for item in result.trajectory_stages]
    assert joints == [ARM, [GRIPPER], ARM, [GRIPPER], ARM]
    plan, _, approach, _, retreat = (item.joint_trajectory.points for item in result.trajectory_stages)
    assert np.allclose(plan[0].positions, START) and np.allclose(plan[-1].positions, approach[0].positions, atol=1e-4)
    assert np.allclose(approach[-1].positions, retreat[0].positions, atol=1e-6)
    for stage, up in ((2, False), (4, True)):
        places = np.array(places_of(result.trajectory_stages[stage]))
        low, high = BLOCK[2] + PALM_TO_BLOCK, BLOCK[2] + PALM_TO_BLOCK + 0.1
        assert np.allclose(places[:, :2], BLOCK[:2], atol=1e-3), "straight"
        assert np.allclose(places[[0, -1], 2], (low, high) if up else (high, low), atol=1e-4)
    assert not arm.grips and arm.positions["elbow_joint"] == START[2] and not held()


def test_the_fingers_keep_their_limits_along_the_cubic_polynomial_of_a_controller(pickup: Any) -> None:
    limits = rospy.get_param(f"robot_description_planning/joint_limits/{GRIPPER}")
    result, report = ask(pickup, pick_goal())
    assert result.error_code.val == OK, report
    for stage in (1, 3):
        points = result.trajectory_stages[stage].joint_trajectory.points
        times_s = [point.time_from_start.to_sec() for point in points]
        spline = CubicHermiteSpline(times_s, [p.positions[0] for p in points], [p.velocities[0] for p in points])
        samples = np.linspace(times_s[0], times_s[-1], 1001)
        assert np.abs(spline(samples, 1)).max() <= 1.01 * limits["max_velocity"]
        assert np.abs(spline(samples, 2)).max() <= 1.01 * limits["max_acceleration"]


def test_a_pick_and_a_place_are_executed(pickup: Any, place: Any, arm: FakeArm) -> None:
    result, report = ask(pickup, pick_goal(plan_only=False))
    assert result.error_code.val == OK and pickup.get_state() == GoalStatus.SUCCEEDED, report
    assert arm.grips == [OPEN, CLOSED] and held() == ["block"]
    assert np.allclose(
        [arm.positions[name] for name in ARM],
        result.trajectory_stages[-1].joint_trajectory.points[-1].positions,
        atol=1e-6,
    )
    assert not [item for item in scene().world.collision_objects if item.id == "block"]
    touched = scene().robot_state.attached_collision_objects[0]
    assert touched.link_name == "ee_link" and "ezgripper_palm_link" in touched.touch_links

    result, report = ask(place, place_goal(plan_only=False))
    assert result.error_code.val == OK, report
    assert result.trajectory_descriptions == ["plan", "approach", "release", "retreat"]
    assert result.place_location.id == "left" and arm.grips == [OPEN, CLOSED, OPEN] and not held()
    block = next(item for item in scene().world.collision_objects if item.id == "block")
    assert np.allclose(
        [block.pose.position.x, block.pose.position.y, block.pose.position.z], [-0.15, 0.5, 0.9005], atol=1e-3
    )


def test_the_best_grasp_that_can_be_done_is_taken_and_the_others_say_why_not(pickup: Any) -> None:
    far = grasp("far", 0.9, (0.1, 2.0, 0.9))
    inside = grasp("inside", 0.8, (0.1, 0.5, 0.80))
    downwards = grasp("downwards", 0.7, post_grasp_retreat=along(0, 0, -1))
    result, report = ask(pickup, pick_goal(grasp("poor", 0.1), inside, grasp("good", 0.5), downwards, far))
    assert result.error_code.val == OK and result.grasp.id == "good"
    reasons = {item["id"]: item["reason"] for item in report["attempts"]}
    assert list(reasons) == ["far", "inside", "downwards"]
    assert "out of reach" in reasons["far"]
    assert "'table'" in reasons["inside"] and "mm deep" in reasons["inside"]
    assert "retreat: only" in reasons["downwards"] and "of 0.100 m" in reasons["downwards"]


def test_when_no_grasp_can_be_done_every_reason_is_reported(pickup: Any) -> None:
    result, report = ask(pickup, pick_goal(grasp("far", 0.9, (0.1, 2.0, 0.9)), grasp("below", 0.8, (0.1, 0.5, 0.8))))
    assert result.error_code.val == CODES.PLANNING_FAILED and not result.trajectory_stages
    for text in (report["reason"], pickup.get_goal_status_text()):
        assert "far: reach" in text and "below: reach" in text and "'table'" in text
    result, _ = ask(pickup, pick_goal(grasp("far", 0.9, (0.1, 2.0, 0.9))))
    assert result.error_code.val == CODES.NO_IK_SOLUTION, "one reason for all is the code"


def test_what_is_in_the_way_of_approach_and_retreat_is_named(pickup: Any) -> None:
    assert add(box("roof", 0.25, 0.5, 1.35, (0.3, 0.3, 0.02)))
    high = grasp(post_grasp_retreat=along(0, 0, 1, 0.3, 0.25))
    result, report = ask(pickup, pick_goal(high))
    assert result.error_code.val == CODES.PLANNING_FAILED
    assert "top: retreat: only" in report["reason"] and "'roof'" in report["reason"]
    allowed = grasp(post_grasp_retreat=along(0, 0, 1, 0.3, 0.02))
    result, report = ask(pickup, pick_goal(allowed))
    assert result.error_code.val == OK, f"the least distance is enough; {report}"


def test_the_approach_may_be_given_in_the_frame_of_the_hand(pickup: Any) -> None:
    result, report = ask(pickup, pick_goal(grasp(pre_grasp_approach=along(1, 0, 0, frame="ee_link"))))
    assert result.error_code.val == OK, report
    places = np.array(places_of(result.trajectory_stages[2]))
    assert places[0, 2] - places[-1, 2] == pytest.approx(0.1, abs=1e-4)


def test_closing_in_stops_before_the_object_is_touched(pickup: Any) -> None:
    plain, _ = ask(pickup, pick_goal(grasp(place_of_block=(0.1, 0.5, 0.97))))
    closer, report = ask(pickup, pick_goal(grasp(place_of_block=(0.1, 0.5, 0.97)), minimize_object_distance=True))
    assert plain.error_code.val == OK and closer.error_code.val == OK, report
    ends = [places_of(item.trajectory_stages[2])[-1][2] for item in (plain, closer)]
    assert ends[0] - ends[1] > 0.005, "it goes further down"


def test_path_constraints_hold_on_the_lines_too(pickup: Any) -> None:
    goal = pick_goal()
    kept = joint_goal("shoulder_lift_joint", START[1])
    kept.joint_constraints[0].tolerance_above = kept.joint_constraints[0].tolerance_below = 0.05
    goal.path_constraints = kept
    result, report = ask(pickup, goal)
    assert result.error_code.val != OK and "shoulder_lift_joint" in report["reason"]


def test_a_place_may_be_given_as_the_pose_of_the_hand(pickup: Any, place: Any) -> None:
    assert ask(pickup, pick_goal(plan_only=False))[0].error_code.val == OK
    goal = place_goal(place_eef=True, attached_object_name="")
    goal.place_locations[0].place_pose.pose = Pose(Point(0.0, 0.5, 0.9005 + PALM_TO_BLOCK), EE_DOWN)
    result, report = ask(place, goal)
    assert result.error_code.val == OK, report
    end = places_of(result.trajectory_stages[1])[-1]
    assert np.allclose(end, (0.0, 0.5, 0.9005 + PALM_TO_BLOCK), atol=1e-4)
    assert held() == ["block"], "planned only"
    inside = place_goal()
    inside.place_locations[0].place_pose.pose.position.z = 0.85
    inside.support_surface_name = ""
    result, report = ask(place, inside)
    assert result.error_code.val != OK and "block" in report["reason"] and "'table'" in report["reason"]


def test_a_wall_that_appears_while_the_arm_goes_there_ends_the_pick(pickup: Any, arm: FakeArm) -> None:
    arm.cancelled.clear()
    pickup.send_goal(pick_goal(plan_only=False))
    until(lambda: [arm.positions[name] for name in ARM] != START, "the begin of the motion")
    assert add(box("lid", 0.1, 0.5, 1.1, (0.3, 0.3, 0.02)))
    assert pickup.wait_for_result(rospy.Duration(20.0))
    result = pickup.get_result()
    assert result.error_code.val == CODES.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
    assert "executing 'plan'" in pickup.get_goal_status_text() and "'lid'" in pickup.get_goal_status_text()
    assert not held() and CLOSED not in arm.grips


def test_moveit_commander_picks_and_places(arm: FakeArm) -> None:
    group = moveit_commander.MoveGroupCommander(GROUP, wait_for_servers=30.0)
    group.set_support_surface_name("table")
    group.set_planning_time(10.0)
    assert group.pick("block", [grasp("far", 0.9, (0.1, 2.0, 0.9)), grasp()], plan_only=True) == OK
    assert group.pick("block", grasp("far", 0.9, (0.1, 2.0, 0.9)), plan_only=True) == CODES.NO_IK_SOLUTION
    assert not held()
    assert group.pick("block", grasp()) == OK and held() == ["block"]
    assert group.place("block", place_goal().place_locations, plan_only=True) is True
    assert group.place("block", place_goal().place_locations) is True and not held()


NAN = float("nan")


@pytest.mark.parametrize(
    ("goal", "codes", "word"),
    [
        (PickupGoal(), {CODES.INVALID_GROUP_NAME}, "group_name"),
        (pick_goal(group_name="nobody"), {CODES.INVALID_GROUP_NAME}, "nobody"),
        (pick_goal(end_effector="nobody"), {CODES.INVALID_GROUP_NAME}, "end effector"),
        (pick_goal(target_name="nothing"), {CODES.INVALID_OBJECT_NAME}, "nothing"),
        (pick_goal(support_surface_name="nothing"), {CODES.INVALID_OBJECT_NAME}, "nothing"),
        (pick_goal(possible_grasps=[]), {CODES.INVALID_GOAL_CONSTRAINTS}, "possible_grasps"),
        (
            pick_goal(grasp(pre_grasp_posture=JointTrajectory(joint_names=["elbow_joint"]))),
            {CODES.INVALID_GOAL_CONSTRAINTS},
            "elbow_joint",
        ),
        (pick_goal(grasp(grasp_posture=fingers(NAN))), {CODES.INVALID_GOAL_CONSTRAINTS}, "finite"),
        (
            pick_goal(grasp(grasp_posture=JointTrajectory(joint_names=[GRIPPER]))),
            {CODES.INVALID_GOAL_CONSTRAINTS},
            "0 points",
        ),
        (pick_goal(grasp(pre_grasp_approach=along(0, 0, 0))), {CODES.INVALID_GOAL_CONSTRAINTS}, "direction"),
        (pick_goal(grasp(pre_grasp_approach=along(0, 0, NAN))), {CODES.INVALID_GOAL_CONSTRAINTS}, "direction"),
        (pick_goal(grasp(pre_grasp_approach=along(0, 0, 1, -0.1, -0.2))), {CODES.INVALID_GOAL_CONSTRAINTS}, "distance"),
        (
            pick_goal(grasp(pre_grasp_approach=along(0, 0, 1, frame="nowhere"))),
            {CODES.FRAME_TRANSFORM_FAILURE},
            "nowhere",
        ),
        (pick_goal(grasp(quality=NAN)), {CODES.INVALID_GOAL_CONSTRAINTS}, "grasp_quality"),
        (pick_goal(grasp(grasp_pose=PoseStamped(Header(frame_id="world"), Pose()))), {CODES.FAILURE}, "quaternion"),
        (pick_goal(allowed_planning_time=NAN), {CODES.TIMED_OUT}, "allowed_planning_time"),
    ],
)
def test_malformed_picks_get_a_code_and_a_reason(pickup: Any, goal: PickupGoal, codes: set[int], word: str) -> None:
    result, report = ask(pickup, goal)
    assert result.error_code.val in codes and word in report["reason"], report


@pytest.mark.parametrize(
    ("goal", "codes", "word"),
    [
        (PlaceGoal(), {CODES.INVALID_GROUP_NAME}, "group_name"),
        (place_goal(), {CODES.INVALID_OBJECT_NAME}, "block"),
        (place_goal(attached_object_name=""), {CODES.INVALID_OBJECT_NAME}, "holds 0"),
        (place_goal(place_locations=[]), {CODES.INVALID_GOAL_CONSTRAINTS}, "place_locations"),
    ],
)
def test_malformed_places_get_a_code_and_a_reason(place: Any, goal: PlaceGoal, codes: set[int], word: str) -> None:
    result, report = ask(place, goal)
    assert result.error_code.val in codes and word in report["reason"], report
