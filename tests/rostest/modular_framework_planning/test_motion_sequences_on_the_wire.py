# SPDX-License-Identifier: BSD-3-Clause
"""PTP, LIN, CIRC and sequences on the wire, with the shipped config package: planned, refused, executed, cancelled."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import (
    Constraints,
    JointConstraint,
    MotionPlanRequest,
    MotionSequenceItem,
    MotionSequenceRequest,
    MoveGroupSequenceAction,
    MoveGroupSequenceGoal,
    MoveItErrorCodes,
    PositionConstraint,
    RobotState,
)
from moveit_msgs.srv import GetMotionSequence, QueryPlannerInterfaces
from sensor_msgs.msg import JointState

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    GRIPPER,
    OK,
    START,
    TIP,
    FakeArm,
    add,
    box,
    call,
    plan,
    pose_constraints,
    report_of,
    request,
    tip_pose,
    vector,
)

PILZ = "pilz_industrial_motion_planner"
CODES = MoveItErrorCodes
pytestmark = [
    pytest.mark.move_group(service="plan_sequence_path", gripper=True),
    pytest.mark.usefixtures("clean_scene"),
]


def to(home: Pose, x: float, y: float, z: float, planner: str = "LIN", **changes: Any) -> MotionPlanRequest:
    goal = pose_constraints(home.position.x + x, home.position.y + y, home.position.z + z, home.orientation)
    return request(
        goal,
        pipeline_id=changes.pop("pipeline_id", PILZ),
        planner_id=planner,
        max_velocity_scaling_factor=0.2,
        max_acceleration_scaling_factor=0.2,
        allowed_planning_time=20.0,  # a slow motion has many states to check
        **changes,
    )


def point_of(home: Pose, name: str, x: float, y: float, z: float) -> Constraints:
    """As clients of Pilz's planner write it: no shape, no orientation."""
    point = PositionConstraint(link_name=TIP)
    point.header.frame_id = "world"
    point.constraint_region.primitive_poses = [
        Pose(Point(home.position.x + x, home.position.y + y, home.position.z + z), Quaternion())
    ]
    return Constraints(name=name, position_constraints=[point])


def rows_of(trajectory: Any) -> np.ndarray:
    return np.array([point.positions for point in trajectory.joint_trajectory.points])


def times_of(trajectory: Any) -> np.ndarray:
    return np.array([point.time_from_start.to_sec() for point in trajectory.joint_trajectory.points])


def test_the_pipeline_and_its_planners_are_listed() -> None:
    known = {
        item.pipeline_id: item.planner_ids
        for item in call("query_planner_interface", QueryPlannerInterfaces).planner_interfaces
    }
    assert sorted(known[PILZ]) == ["CIRC", "LIN", "PTP"] and "ompl" in known


def test_ptp_is_the_default_and_ends_at_joint_goals(home: Pose) -> None:
    goal = Constraints(joint_constraints=[JointConstraint(joint_name=ARM[0], position=1.2)])
    answer = plan(request(goal, pipeline_id=PILZ))
    assert answer.error_code.val == OK
    rows = rows_of(answer.trajectory)
    assert rows[-1][0] == pytest.approx(1.2) and np.allclose(rows[:, 1:], START[1:], atol=1e-6)


def test_lin_is_straight(home: Pose) -> None:
    answer = plan(to(home, 0.15, 0.0, -0.1))
    assert answer.error_code.val == OK
    direction = np.array([0.15, 0.0, -0.1]) / np.linalg.norm([0.15, 0.0, -0.1])
    for values in rows_of(answer.trajectory):
        way = vector(tip_pose(values)) - vector(home)
        assert np.linalg.norm(way - (way @ direction) * direction) < 1e-4
    assert (np.diff(times_of(answer.trajectory)) > 0.0).all()


@pytest.mark.parametrize(
    ("name", "point", "goal"),
    [("interim", (0.05, 0, -0.05), (0.1, 0.0, 0.0)), ("center", (0.05, 0, 0), (0.05, 0.0, -0.05))],
)
def test_circ_is_a_circle(
    home: Pose, name: str, point: tuple[float, float, float], goal: tuple[float, float, float]
) -> None:
    answer = plan(to(home, *goal, planner="CIRC", path_constraints=point_of(home, name, *point)))
    assert answer.error_code.val == OK
    centre = vector(home) + np.array([0.05, 0.0, 0.0])
    for values in rows_of(answer.trajectory):
        assert np.linalg.norm(vector(tip_pose(values)) - centre) == pytest.approx(0.05, abs=1e-4)


def test_refusals_have_a_code_and_a_reason(home: Pose) -> None:
    moving = RobotState(joint_state=JointState(name=ARM, position=START, velocity=[0.0, 0.0, 0.3, 0.0, 0.0, 0.0]))
    for message, code, text in (
        (to(home, 0.1, 0, 0, planner="RRTConnect"), CODES.PLANNING_FAILED, "PTP, LIN, CIRC"),
        (to(home, 0.1, 0, 0, start_state=moving), CODES.INVALID_ROBOT_STATE, "elbow_joint"),
        (to(home, 0.1, 0, 0, planner="CIRC"), CODES.INVALID_MOTION_PLAN, "center"),
        (
            to(home, 0.1, 0, 0, planner="CIRC", path_constraints=point_of(home, "center", 0.05, 0, 0)),
            CODES.INVALID_MOTION_PLAN,
            "half",
        ),
        (to(home, 0, 2.0, 0), CODES.NO_IK_SOLUTION, "out of reach"),
    ):
        answer, report = report_of(lambda message=message: plan(message))
        assert answer.error_code.val == code and text in report["reason"], report


def test_nothing_is_gone_around(home: Pose) -> None:
    assert add(box("post", home.position.x + 0.15, home.position.y, home.position.z - 0.1, (0.02, 0.02, 0.5)))
    answer, report = report_of(lambda: plan(to(home, 0.3, 0, 0)))
    assert answer.error_code.val == CODES.INVALID_MOTION_PLAN and "'post'" in report["reason"]


def sequence(*items: tuple[MotionPlanRequest, float]) -> MotionSequenceRequest:
    return MotionSequenceRequest([MotionSequenceItem(req=message, blend_radius=radius) for message, radius in items])


def solve(message: MotionSequenceRequest) -> Any:
    return call("plan_sequence_path", GetMotionSequence, message).response


def square(home: Pose, radius: float) -> MotionSequenceRequest:
    return sequence((to(home, 0.2, 0, 0), radius), (to(home, 0.2, 0, -0.15), radius), (to(home, 0, 0, -0.15), 0.0))


def test_a_blended_sequence_is_one_trajectory_and_faster_than_one_that_stops(home: Pose) -> None:
    blended, stopping = solve(square(home, 0.05)), solve(square(home, 0.0))
    for answer in (blended, stopping):
        assert answer.error_code.val == OK and len(answer.planned_trajectories) == 1
        assert (np.diff(times_of(answer.planned_trajectories[0])) > 0.0).all()
        end = vector(tip_pose(rows_of(answer.planned_trajectories[0])[-1])) - vector(home)
        assert np.allclose(end, [0.0, 0.0, -0.15], atol=1e-4)
        assert list(answer.sequence_start.joint_state.name)
    assert times_of(blended.planned_trajectories[0])[-1] < times_of(stopping.planned_trajectories[0])[-1] - 0.1


def gripper(position: float) -> MotionPlanRequest:
    goal = Constraints(joint_constraints=[JointConstraint(joint_name=GRIPPER, position=position)])
    return request(goal, group_name="ezgripper", pipeline_id=PILZ, planner_id="PTP")


def test_a_change_of_group_begins_another_trajectory(home: Pose) -> None:
    answer = solve(sequence((to(home, 0.1, 0, 0), 0.05), (gripper(0.5), 0.0), (to(home, 0.1, 0, -0.1), 0.0)))
    assert answer.error_code.val == OK
    joints = [list(item.joint_trajectory.joint_names) for item in answer.planned_trajectories]
    assert joints[0] == joints[2] == ARM and GRIPPER in joints[1]
    assert np.allclose(rows_of(answer.planned_trajectories[0])[-1], rows_of(answer.planned_trajectories[2])[0])


def test_an_empty_sequence_is_done_at_once() -> None:
    answer = solve(MotionSequenceRequest())
    assert answer.error_code.val == OK and not answer.planned_trajectories


def test_a_sequence_reports_what_planned_each_motion_also_one_that_fails(home: Pose) -> None:
    lost = to(home, 0, 3.0, 0, "BKPIECEE", pipeline_id="ompl")
    answer, report = report_of(lambda: solve(sequence((to(home, 0.1, 0, 0), 0.0), (lost, 0.0))))
    assert answer.error_code.val != OK
    assert [(run["pipeline"], run["planner"], run["replaced"]) for run in report["runs"]] == [
        (PILZ, "LIN", ""),
        ("ompl", "RRTConnect", "BKPIECEE"),
    ]


def test_rules_of_a_sequence_are_kept_and_reported(home: Pose) -> None:
    first, second, third = to(home, 0.1, 0, 0), to(home, 0.1, 0, -0.1), to(home, 0, 0, -0.1)
    here = RobotState(joint_state=JointState(name=ARM, position=START))
    started = to(home, 0.1, 0, -0.1, start_state=here)
    for message, code, text in (
        (sequence((first, -0.01), (second, 0.0)), CODES.INVALID_MOTION_PLAN, "items[0].blend_radius is -0.01"),
        (sequence((first, 0.01), (second, 0.01)), CODES.INVALID_MOTION_PLAN, "the last radius must be 0"),
        (sequence((first, 0.0), (started, 0.0)), CODES.INVALID_ROBOT_STATE, "items[1].start_state"),
        (sequence((first, 0.06), (second, 0.06), (third, 0.0)), CODES.INVALID_MOTION_PLAN, "overlap"),
        (sequence((first, 0.0), (to(home, 0, 3.0, 0), 0.0)), CODES.NO_IK_SOLUTION, "items[1]: "),
        (sequence((first, 0.0), (to(home, 0, 0, 0, group_name="nobody"), 0.0)), CODES.INVALID_GROUP_NAME, "nobody"),
        (sequence((first, float("nan")), (second, 0.0)), CODES.INVALID_MOTION_PLAN, "is nan"),
    ):
        answer, report = report_of(lambda message=message: solve(message))
        assert answer.error_code.val == code and text in report["reason"], report
        assert not answer.planned_trajectories, "all or nothing"


@pytest.fixture(scope="module")
def client(session: Any) -> Any:
    client = SteadyActionClient("sequence_move_group", MoveGroupSequenceAction)
    assert client.wait_for_server(rospy.Duration(20.0))
    return client


def run(client: Any, message: MotionSequenceRequest, plan_only: bool = False) -> Any:
    goal = MoveGroupSequenceGoal(request=message)
    goal.planning_options.plan_only = plan_only
    client.send_goal_and_wait(goal, rospy.Duration(60.0))
    return client.get_result().response


def test_the_action_plans_without_moving_and_moves(home: Pose, arm: FakeArm, client: Any) -> None:
    before = dict(arm.positions)
    assert run(client, square(home, 0.05), plan_only=True).error_code.val == OK
    assert arm.positions == before
    answer = run(client, square(home, 0.05))
    assert answer.error_code.val == OK
    end = rows_of(answer.planned_trajectories[-1])[-1]
    assert np.allclose([arm.positions[name] for name in ARM], end, atol=1e-6)


def test_a_sequence_runs_even_where_the_robot_is_at_the_goal(home: Pose, client: Any) -> None:
    there_and_back = sequence((to(home, 0.05, 0, 0), 0.0), (to(home, 0, 0, 0), 0.0))
    answer = run(client, there_and_back)
    assert answer.error_code.val == OK
    rows = rows_of(answer.planned_trajectories[0])
    assert np.abs(rows - rows[0]).max() > 0.02 and np.allclose(rows[0], rows[-1], atol=1e-3)


def test_a_sequence_that_cannot_be_planned_moves_nothing(home: Pose, arm: FakeArm, client: Any) -> None:
    before = dict(arm.positions)
    answer = run(client, sequence((to(home, 0.1, 0, 0), 0.0), (to(home, 0, 3.0, 0), 0.0)))
    assert answer.error_code.val == CODES.NO_IK_SOLUTION and arm.positions == before


def test_a_cancel_stops_the_sequence(home: Pose, arm: FakeArm, client: Any) -> None:
    slow = square(home, 0.05)
    for item in slow.items:
        item.req.max_velocity_scaling_factor = 0.05
    arm.cancelled.clear()
    moving = threading.Event()
    client.send_goal(
        MoveGroupSequenceGoal(request=slow),
        feedback_cb=lambda feedback: moving.set() if feedback.state == "MONITOR" else None,
    )
    assert moving.wait(120.0)  # planning takes longer, the longer the motion takes
    time.sleep(0.5)
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(20.0))
    assert client.get_result().response.error_code.val == CODES.PREEMPTED
    assert arm.cancelled.wait(2.0)
