# SPDX-License-Identifier: BSD-3-Clause
"""Constraints and kinematics on the wire: goals of any mix, compute_ik, compute_fk and check_state_validity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from moveit_msgs.msg import (
    BoundingVolume,
    Constraints,
    JointConstraint,
    MoveItErrorCodes,
    OrientationConstraint,
    PlanningSceneComponents,
    PositionConstraint,
    PositionIKRequest,
    RobotState,
    VisibilityConstraint,
)
from moveit_msgs.srv import (
    GetCartesianPath,
    GetCartesianPathRequest,
    GetPlanningScene,
    GetPositionFK,
    GetPositionIK,
    GetStateValidity,
)
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import Header

from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    GROUP,
    OK,
    START,
    TIP,
    add,
    box,
    call,
    hold,
    plan,
    pose_constraints,
    report_of,
    request,
    table,
    tip_pose,
    vector,
)

CODES = MoveItErrorCodes
NAN = float("nan")
UNTURNED = Quaternion(0, 0, 0, 1)
pytestmark = [pytest.mark.usefixtures("clean_scene")]


def in_box(x: float, y: float, z: float, size: tuple[float, float, float], **changes: Any) -> PositionConstraint:
    message = PositionConstraint(
        Header(frame_id="world"),
        TIP,
        Vector3(),
        BoundingVolume([SolidPrimitive(SolidPrimitive.BOX, list(size))], [Pose(Point(x, y, z), UNTURNED)], [], []),
        1.0,
    )
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def turned(x: float, y: float, z: float, **changes: Any) -> OrientationConstraint:
    message = OrientationConstraint(Header(frame_id="world"), DOWN, TIP, x, y, z, 0, 1.0)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def pose_at(values: Any, link: str = TIP) -> tuple[np.ndarray, Rotation]:
    """Where compute_fk says a link is."""
    pose = tip_pose(values, link=link)
    q = pose.orientation
    return vector(pose), Rotation.from_quat([q.x, q.y, q.z, q.w])


def end_of(answer: Any) -> list[float]:
    trajectory = answer.trajectory.joint_trajectory
    return [trajectory.points[-1].positions[trajectory.joint_names.index(name)] for name in ARM]


def tilt(rotation: Rotation) -> float:
    """Angle between the tool's z axis and straight down."""
    return float(np.arccos(np.clip(-rotation.apply([0, 0, 1])[2], -1.0, 1.0)))


def test_a_goal_may_be_a_position_alone_an_orientation_alone_or_partly_tolerant() -> None:
    region = in_box(0.2, 0.5, 1.1, (0.1, 0.1, 0.1))
    answer = plan(request(Constraints(position_constraints=[region])))
    assert answer.error_code.val == OK
    assert np.abs(pose_at(end_of(answer))[0] - (0.2, 0.5, 1.1)).max() <= 0.05 + 1e-5
    answer = plan(request(Constraints(orientation_constraints=[turned(0.1, 0.1, 7.0)])))
    assert answer.error_code.val == OK and tilt(pose_at(end_of(answer))[1]) <= 0.1 * np.sqrt(2) + 1e-5
    answer = plan(request(Constraints(position_constraints=[region], orientation_constraints=[turned(0.1, 0.1, 7.0)])))
    assert answer.error_code.val == OK
    position, rotation = pose_at(end_of(answer))
    assert np.abs(position - (0.2, 0.5, 1.1)).max() <= 0.05 + 1e-5 and tilt(rotation) <= 0.1 * np.sqrt(2) + 1e-5


def test_joints_positions_and_orientations_may_be_mixed_in_one_goal() -> None:
    pan = JointConstraint("shoulder_pan_joint", 1.2, 0.3, 0.3, 1.0)
    goal = Constraints(
        joint_constraints=[pan],
        position_constraints=[in_box(0.1, 0.5, 1.1, (0.4, 0.4, 0.4))],
        orientation_constraints=[turned(0.3, 0.3, 7.0)],
    )
    answer = plan(request(goal))
    assert answer.error_code.val == OK
    end = end_of(answer)
    assert 0.9 - 1e-5 <= end[0] <= 1.5 + 1e-5 and tilt(pose_at(end)[1]) <= 0.3 * np.sqrt(2) + 1e-5
    assert np.abs(pose_at(end)[0] - (0.1, 0.5, 1.1)).max() <= 0.2 + 1e-5


def test_regions_are_alternatives_and_an_offset_point_is_what_must_be_inside() -> None:
    region = in_box(0.0, 0.0, 9.0, (0.1, 0.1, 0.1), target_point_offset=Vector3(0.0, 0.0, 0.1))
    corners = [Point(x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
    mesh = Mesh([MeshTriangle([0, 1, 2]), MeshTriangle([5, 6, 7])], corners)
    region.constraint_region.meshes = [mesh]
    region.constraint_region.mesh_poses = [Pose(Point(0.2, 0.5, 1.0), UNTURNED)]
    answer = plan(request(Constraints(position_constraints=[region])))
    assert answer.error_code.val == OK
    position, rotation = pose_at(end_of(answer))
    assert np.abs(position + rotation.apply([0, 0, 0.1]) - (0.2, 0.5, 1.0)).max() <= 0.05 + 1e-5


def test_a_joint_goal_whose_exact_target_collides_is_met_within_its_tolerance() -> None:
    answer = plan(request(Constraints(joint_constraints=[JointConstraint(ARM[0], START[0] + 1.0, 0, 0, 1.0)])))
    assert answer.error_code.val == OK
    blocked, _ = pose_at(end_of(answer), "wrist_2_link")
    add(box("post", float(blocked[0]), float(blocked[1]), float(blocked[2]), (0.15, 0.15, 0.15)))
    exact = Constraints(joint_constraints=[JointConstraint(ARM[0], START[0] + 1.0, 0, 0, 1.0)])
    refused, report = report_of(lambda: plan(request(exact)))
    assert refused.error_code.val == CODES.GOAL_IN_COLLISION and "'post'" in report["reason"]
    loose = Constraints(joint_constraints=[JointConstraint(ARM[0], START[0] + 1.0, 0.9, 0.9, 1.0)])
    answer = plan(request(loose))
    assert answer.error_code.val == OK and 1e-3 < abs(end_of(answer)[0] - START[0] - 1.0) <= 0.9 + 1e-6


def test_a_region_that_cannot_be_reached_is_called_empty() -> None:
    goal = Constraints(position_constraints=[in_box(0.0, 0.0, 9.0, (0.1, 0.1, 0.1))])
    answer, report = report_of(lambda: plan(request(goal)))
    assert answer.error_code.val == CODES.GOAL_CONSTRAINTS_VIOLATED
    assert "goal region was empty" in report["reason"] and TIP in report["reason"]


NO_POSE = in_box(
    0.2,
    0.5,
    1.1,
    (0.1, 0.1, 0.1),
    constraint_region=BoundingVolume([SolidPrimitive(SolidPrimitive.BOX, [0.1, 0.1, 0.1])], [], [], []),
)
EMPTY = in_box(0.2, 0.5, 1.1, (0.1, 0.1, 0.1), constraint_region=BoundingVolume())
OLD_KIND = in_box(
    0.2,
    0.5,
    1.1,
    (0.1, 0.1, 0.1),
    constraint_region=BoundingVolume([SolidPrimitive(9, [0.1])], [Pose(Point(0.2, 0.5, 1.1), UNTURNED)], [], []),
)


@pytest.mark.parametrize(
    ("constraints", "code", "words"),
    [
        (Constraints(visibility_constraints=[VisibilityConstraint()]), CODES.INVALID_GOAL_CONSTRAINTS, "visibility"),
        (Constraints(position_constraints=[EMPTY]), CODES.INVALID_GOAL_CONSTRAINTS, "is empty"),
        (Constraints(position_constraints=[NO_POSE]), CODES.INVALID_GOAL_CONSTRAINTS, "0 poses"),
        (Constraints(position_constraints=[OLD_KIND]), CODES.INVALID_GOAL_CONSTRAINTS, "type 9; allowed types: 1 box"),
        (
            Constraints(position_constraints=[in_box(NAN, 0, 1, (0.1, 0.1, 0.1))]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "finite",
        ),
        (
            Constraints(position_constraints=[in_box(0, 0, 1, (0.1, -1.0, 0.1))]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "y is -1",
        ),
        (
            Constraints(position_constraints=[in_box(0, 0, 1, (0.1, 0.1, 0.1), link_name="nobody")]),
            CODES.INVALID_LINK_NAME,
            "'nobody' does not exist",
        ),
        (
            Constraints(position_constraints=[in_box(0, 0, 1, (0.1, 0.1, 0.1), weight=NAN)]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "weight",
        ),
        (
            Constraints(orientation_constraints=[turned(NAN, 0.1, 0.1)]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "absolute_x_axis",
        ),
        (
            Constraints(orientation_constraints=[turned(0.1, 0.1, 0.1, parameterization=7)]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "1 ROTATION_VECTOR",
        ),
        (
            Constraints(orientation_constraints=[turned(0.1, 0.1, 0.1, header=Header(frame_id="nowhere"))]),
            CODES.FRAME_TRANSFORM_FAILURE,
            "'nowhere'",
        ),
        (
            Constraints(joint_constraints=[JointConstraint(ARM[0], 0.0, -0.1, 0.1, 1.0)]),
            CODES.INVALID_GOAL_CONSTRAINTS,
            "tolerance_above is -0.1",
        ),
    ],
)
def test_goals_without_meaning_get_a_code_and_a_reason(constraints: Constraints, code: int, words: str) -> None:
    answer, report = report_of(lambda: plan(request(constraints)))
    assert answer.error_code.val == code and words in report["reason"], report["reason"]


def ik(**changes: Any) -> PositionIKRequest:
    message = PositionIKRequest(group_name=GROUP, ik_link_name=TIP, avoid_collisions=True)
    message.pose_stamped = PoseStamped(Header(frame_id="world"), Pose(Point(0.1, 0.5, 0.95), DOWN))
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def solve(message: PositionIKRequest) -> tuple[int, list[float]]:
    answer = call("compute_ik", GetPositionIK, message)
    state = dict(zip(answer.solution.joint_state.name, answer.solution.joint_state.position, strict=True))
    return answer.error_code.val, [state.get(name, NAN) for name in ARM]


def test_ik_keeps_constraints_and_says_which_it_cannot_keep() -> None:
    _, nearest = solve(ik())
    other = Constraints(joint_constraints=[JointConstraint("elbow_joint", -1.5, 1.5, 1.5, 1.0)])
    code, values = solve(ik(constraints=other))
    assert code == OK and values[2] < 0.0 < nearest[2], "the elbow on the other side"
    position, rotation = pose_at(values)
    assert np.abs(position - (0.1, 0.5, 0.95)).max() < 1e-6 and tilt(rotation) < 1e-6
    impossible = Constraints(joint_constraints=[JointConstraint("elbow_joint", 0.0, 0.01, 0.01, 1.0)])
    answer, report = report_of(lambda: call("compute_ik", GetPositionIK, ik(constraints=impossible)))
    assert answer.error_code.val == CODES.NO_IK_SOLUTION and "'elbow_joint' is" in report["reason"]


def test_ik_of_a_chain_is_for_one_tip_which_may_come_as_a_list_of_one() -> None:
    stamped = ik().pose_stamped
    assert solve(ik(ik_link_name="", ik_link_names=[TIP], pose_stamped_vector=[stamped]))[0] == OK
    several = ik(ik_link_names=[TIP, "tool0"], pose_stamped_vector=[stamped, stamped])
    answer, report = report_of(lambda: call("compute_ik", GetPositionIK, several))
    assert answer.error_code.val == CODES.NO_IK_SOLUTION and "is a chain with one tip link" in report["reason"]


def test_ik_places_a_held_object() -> None:
    hold(box("block", 0.0, 0.0, 0.1, (0.04, 0.04, 0.04)))
    code, values = solve(ik(ik_link_name="block", robot_state=RobotState(is_diff=True), avoid_collisions=False))
    assert code == OK
    position, rotation = pose_at(values)
    assert np.abs(position + rotation.apply([0, 0, 0.1]) - (0.1, 0.5, 0.95)).max() < 1e-6


def test_with_position_only_ik_the_orientation_is_open() -> None:
    hold(box("block", 0.0, 0.0, 0.1, (0.04, 0.04, 0.04)))
    ask = ik(group_name="arm", ik_link_name="block", robot_state=RobotState(is_diff=True), avoid_collisions=True)
    ask.pose_stamped.pose.orientation = Quaternion(0.6, 0.0, 0.8, 0.0)
    code, values = solve(ask)
    assert code == OK
    position, rotation = pose_at(values)
    assert np.abs(position + rotation.apply([0, 0, 0.1]) - (0.1, 0.5, 0.95)).max() < 1e-6
    assert np.linalg.norm(np.subtract(values, START)) < 0.8, "a state further than needed"
    ask.pose_stamped.pose.position.z = 4.0
    (code, _), report = report_of(lambda: solve(ask))
    assert code == CODES.NO_IK_SOLUTION and "position_only_ik" in report["reason"]


def test_validity_answers_every_constraint_and_every_contact() -> None:
    constraints = Constraints(
        joint_constraints=[JointConstraint(ARM[0], START[0] + 0.2, 0.1, 0.1, 2.0)],
        position_constraints=[in_box(0.0, 0.5, 1.1, (9.0, 9.0, 9.0))],
        orientation_constraints=[turned(9.0, 9.0, 9.0)],
    )
    answer = call("check_state_validity", GetStateValidity, RobotState(is_diff=True), GROUP, constraints)
    assert not answer.valid and [item.result for item in answer.constraint_result] == [False, True, True]
    assert answer.constraint_result[0].distance == pytest.approx(0.4, abs=1e-6)
    assert not answer.contacts and not answer.cost_sources
    constraints.joint_constraints[0].tolerance_below = 0.3
    assert call("check_state_validity", GetStateValidity, RobotState(is_diff=True), GROUP, constraints).valid
    at, _ = pose_at(START, "wrist_2_link")
    add(table(), box("inside", float(at[0]), float(at[1]), float(at[2]), (0.15, 0.15, 0.15)))
    answer = call("check_state_validity", GetStateValidity, RobotState(is_diff=True), GROUP, Constraints())
    assert not answer.valid and any("inside" in (item.contact_body_1, item.contact_body_2) for item in answer.contacts)
    constraints.visibility_constraints = [VisibilityConstraint()]
    answer, report = report_of(
        lambda: call("check_state_validity", GetStateValidity, RobotState(is_diff=True), GROUP, constraints)
    )
    assert not answer.valid and "visibility" in report["reason"]


def test_validity_says_which_constraint_is_refused_and_answers_the_others() -> None:
    constraints = Constraints(
        joint_constraints=[JointConstraint(ARM[0], START[0], 0.1, 0.1, 1.0), JointConstraint("knee", 0.0, 0.1, 0.1, 1)],
        orientation_constraints=[turned(9.0, 9.0, 9.0)],
        visibility_constraints=[VisibilityConstraint()],
    )
    answer, report = report_of(
        lambda: call("check_state_validity", GetStateValidity, RobotState(is_diff=True), GROUP, constraints)
    )
    assert not answer.valid and [item.result for item in answer.constraint_result] == [True, False, True, False]
    assert [np.isinf(item.distance) for item in answer.constraint_result] == [False, True, False, True]
    assert "constraints.joint_constraints[1]: joint 'knee'" in report["reason"]
    assert "constraints.visibility_constraints[0]" in report["reason"]


def test_an_orientation_that_was_not_filled_in_is_the_identity() -> None:
    given, empty = turned(9.0, 9.0, 9.0), turned(9.0, 9.0, 9.0)
    given.orientation, empty.orientation = Quaternion(0, 0, 0, 1), Quaternion()
    results = [
        call(
            "check_state_validity",
            GetStateValidity,
            RobotState(is_diff=True),
            GROUP,
            Constraints(orientation_constraints=[item]),
        ).constraint_result[0]
        for item in (given, empty)
    ]
    assert results[0] == results[1]
    regions = [in_box(0.2, 0.5, 1.1, (0.1, 0.2, 0.3)) for _ in range(2)]
    regions[1].constraint_region.primitive_poses[0].orientation = Quaternion()
    results = [
        call(
            "check_state_validity",
            GetStateValidity,
            RobotState(is_diff=True),
            GROUP,
            Constraints(position_constraints=[item]),
        ).constraint_result[0]
        for item in regions
    ]
    assert results[0] == results[1] and np.isfinite(results[0].distance)


@pytest.mark.parametrize("length", [2.0, 15.1, 1e-4])
def test_orientations_of_any_length_are_normalised(length: float) -> None:
    tilted = Rotation.from_rotvec([0.0, 0.2, 0.0]) * Rotation.from_quat([1.0, 0.0, 0.0, 0.0])
    long = Quaternion(*(length * tilted.as_quat()))

    def is_tilted(values: list[float]) -> bool:
        position, rotation = pose_at(values)
        turn = (rotation.inv() * tilted).magnitude()
        return bool(np.abs(position - (0.1, 0.5, 0.95)).max() < 2e-3 and turn < 2e-3)

    code, values = solve(ik(pose_stamped=PoseStamped(Header(frame_id="world"), Pose(Point(0.1, 0.5, 0.95), long))))
    assert code == OK and is_tilted(values)
    kept = turned(0.02, 0.02, 9.0, orientation=Quaternion(length, 0.0, 0.0, 0.0))
    path = Constraints(orientation_constraints=[turned(0.5, 0.5, 9.0, orientation=long)])
    assert solve(ik(constraints=Constraints(orientation_constraints=[kept])))[0] == OK
    answer = plan(request(pose_constraints(0.1, 0.5, 0.95, long), path_constraints=path))
    assert answer.error_code.val == OK and is_tilted(end_of(answer))
    state = RobotState(joint_state=JointState(name=ARM, position=START), is_diff=True)
    home, level = tip_pose(START), Rotation.from_quat([1.0, 0.0, 0.0, 0.0])
    lines = call(
        "compute_cartesian_path",
        GetCartesianPath,
        GetCartesianPathRequest(
            header=Header(frame_id="world"),
            start_state=state,
            group_name=GROUP,
            waypoints=[Pose(home.position, long)],
            max_step=0.01,
            avoid_collisions=True,
        ),
    )
    assert lines.error_code.val == OK and lines.fraction == 1.0
    tilt_at_end = pose_at(lines.solution.joint_trajectory.points[-1].positions)[1]
    assert (tilt_at_end.inv() * tilted).magnitude() < 1e-3 < (level.inv() * tilted).magnitude()
    distances = []
    for orientation in (long, Quaternion(*tilted.as_quat())):
        region = in_box(0.2, 0.5, 1.1, (0.1, 0.2, 0.3))
        region.constraint_region.primitive_poses[0].orientation = orientation
        goal = Constraints(position_constraints=[region])
        distances.append(
            call("check_state_validity", GetStateValidity, state, GROUP, goal).constraint_result[0].distance
        )
    assert distances[0] == pytest.approx(distances[1], abs=1e-9)
    item = box("crate", 0.0, 0.0, 0.3, (0.1, 0.1, 0.1))
    item.subframe_names, item.subframe_poses = ["side"], [Pose(Point(0.05, 0.0, 0.0), long)]
    item.pose.orientation = item.primitive_poses[0].orientation = long
    assert add(item)
    held = box("held", 0.0, 0.0, 0.1, (0.04, 0.04, 0.04))
    held.pose.orientation = long
    hold(held)
    scene = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    attached = scene.robot_state.attached_collision_objects[0].object
    crate = scene.world.collision_objects[0]
    for seen in (crate.pose, crate.subframe_poses[0], attached.pose):
        q = seen.orientation
        assert abs(np.dot([q.x, q.y, q.z, q.w], tilted.as_quat())) == pytest.approx(1.0, abs=1e-9)


def test_fk_answers_many_links_in_any_frame() -> None:
    state = RobotState(joint_state=JointState(name=ARM, position=START), is_diff=True)
    answer = call("compute_fk", GetPositionFK, Header(frame_id=TIP), [TIP, "base_link", "forearm_link"], state)
    assert answer.error_code.val == OK and answer.fk_link_names == [TIP, "base_link", "forearm_link"]
    own = answer.pose_stamped[0].pose
    assert np.allclose([own.position.x, own.position.y, own.position.z, own.orientation.w], [0, 0, 0, 1], atol=1e-9)
