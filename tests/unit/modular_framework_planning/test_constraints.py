# SPDX-License-Identifier: BSD-3-Clause
"""Constraints: the verdict agrees with an independent reading, and projected states satisfy."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from modular_framework_planning.constraints.compiled_constraints import pose_deviations
from modular_framework_planning.constraints.constraint_arrays import full_joint_mapping
from modular_framework_planning.constraints.constraint_kinds import (
    FrameOnRobot,
    JointConstraint,
    OrientationConstraint,
    Parameterization,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.regions import (
    BoxSolid,
    ConeSolid,
    CylinderSolid,
    HullSolid,
    Solid,
    SphereSolid,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

TIP = "eg_manipulator"
SEEDS = st.integers(0, 2**32 - 1)
CUBE = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])
SOLIDS: dict[str, Solid] = {
    "box": BoxSolid(0.2, 0.4, 0.6),
    "sphere": SphereSolid(0.3),
    "cylinder": CylinderSolid(0.4, 0.2),
    "cone": ConeSolid(0.6, 0.3),
    "mesh": HullSolid(CUBE),
}


def inside(kind: str, point: np.ndarray) -> bool:
    x, y, z = point
    return {
        "box": abs(x) <= 0.1 and abs(y) <= 0.2 and abs(z) <= 0.3,
        "sphere": x * x + y * y + z * z <= 0.09,
        "cylinder": abs(z) <= 0.2 and np.hypot(x, y) <= 0.2,
        "cone": abs(z) <= 0.3 and np.hypot(x, y) <= 0.3 * (0.3 - z) / 0.6,
        "mesh": abs(x) <= 0.1 and abs(y) <= 0.2 and abs(z) <= 0.3,
    }[kind]


@pytest.mark.parametrize("kind", SOLIDS)
def test_samples_fill_the_solid_evenly(kind: str) -> None:
    rng = np.random.default_rng(7)
    points = np.array([SOLIDS[kind].sample(rng) for _ in range(4000)])
    dense = rng.uniform(-0.3, 0.3, (40000, 3))
    even = dense[[inside(kind, point) for point in dense]]
    assert np.abs(points.mean(axis=0) - even.mean(axis=0)).max() < 0.01
    assert np.abs(points.std(axis=0) - even.std(axis=0)).max() < 0.01


def test_solids_without_meaning_are_refused() -> None:
    for build in (
        lambda: BoxSolid(-1.0, 1.0, 1.0),
        lambda: SphereSolid(np.nan),
        lambda: HullSolid(np.zeros((8, 3))),
        lambda: HullSolid(CUBE[:3]),
        lambda: HullSolid(np.full((8, 3), np.inf)),
    ):
        with pytest.raises(GeometryError, match="must be|enclose no volume"):
            build()


def on_link(model: RobotModel, link: str = TIP) -> FrameOnRobot:
    frame = model.pin_model.frames[model.frame_ids[link]]
    return FrameOnRobot(link, int(frame.parentJoint), frame.placement)


def random_state(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    positions = model.default_positions()
    positions[model.group("arm_and_manipulator").indices] = rng.uniform(-np.pi, np.pi, 6)
    return positions


WORLD = FrameOnRobot("world", 0, pin.SE3.Identity())


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_orientation_verdicts_agree_with_another_librarys_angles(model: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions, target = random_state(model, rng), Rotation.random(rng=rng)
    current = Rotation.from_matrix(model.link_transforms(positions)[TIP].rotation)
    deviation = target.inv() * current
    expected = {
        Parameterization.XYZ_EULER_ANGLES: deviation.as_euler("XYZ"),
        Parameterization.ROTATION_VECTOR: target.apply(deviation.as_rotvec()),
    }
    for kind, angles in expected.items():
        tolerances = np.abs(angles) + rng.choice([-0.01, 0.01], 3)
        constraint = OrientationConstraint(on_link(model), WORLD, target.as_matrix(), tolerances, kind, 2.0)
        (result,) = KinematicConstraints(model, orientations=[constraint]).evaluate(positions)
        assert result.satisfied == bool((tolerances > np.abs(angles)).all())
        assert result.distance == pytest.approx(2.0 * np.abs(angles).sum(), abs=1e-6)


def test_where_roll_and_yaw_turn_about_one_axis_either_tolerance_may_take_the_turn(model: RobotModel) -> None:
    positions = model.default_positions()
    turned = Rotation.from_euler("XYZ", [0.4, np.pi / 2, 0.2])
    target = Rotation.from_matrix(model.link_transforms(positions)[TIP].rotation) * turned.inv()
    for tolerances, expected in (((0.7, 2.0, 0.1), True), ((0.1, 2.0, 0.7), True), ((0.5, 2.0, 0.5), False)):
        constraint = OrientationConstraint(on_link(model), WORLD, target.as_matrix(), np.array(tolerances))
        (result,) = KinematicConstraints(model, orientations=[constraint]).evaluate(positions)
        assert result.satisfied == expected
        assert result.distance == pytest.approx(0.6 + np.pi / 2, abs=1e-6)


@pytest.mark.parametrize("kind", SOLIDS)
@settings(max_examples=100, deadline=None)
@given(seed=SEEDS)
def test_no_point_of_a_region_is_nearer_than_the_distance_from_the_region(
    model: RobotModel, kind: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    solid, point, positions = SOLIDS[kind], rng.uniform(-0.6, 0.6, 3), model.default_positions()
    region = ((solid, model.link_transforms(positions)[TIP]),)
    constraints = KinematicConstraints(model, positions=[PositionConstraint(on_link(model), point, WORLD, region)])
    arrays, columns = constraints.arrays
    excesses, deviations = pose_deviations(arrays, full_joint_mapping(columns), positions)
    assert deviations[0] == pytest.approx(point, abs=1e-9)
    assert (excesses[0] < 1e-9) == inside(kind, point)
    for _ in range(20):
        other = solid.sample(rng)
        assert inside(kind, other * (1.0 - 1e-9))
        assert np.linalg.norm(other - point) >= excesses[0] - 1e-9


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_a_position_is_kept_in_any_of_the_regions_of_a_turned_frame(model: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = random_state(model, rng)
    offset, reference = rng.uniform(-0.1, 0.1, 3), pin.SE3.Random()
    kinds = list(rng.choice(list(SOLIDS), 2))
    poses = [pin.SE3(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.3, 0.3, 3)) for _ in kinds]
    point = model.link_transforms(positions)[TIP].act(offset)
    reference = pin.SE3(reference.rotation, point + rng.uniform(-0.3, 0.3, 3))
    constraint = PositionConstraint(
        on_link(model),
        offset,
        FrameOnRobot("table", 0, reference),
        tuple((SOLIDS[kind], pose) for kind, pose in zip(kinds, poses, strict=True)),
    )
    expected = any(inside(kind, (reference * pose).actInv(point)) for kind, pose in zip(kinds, poses, strict=True))
    assert KinematicConstraints(model, positions=[constraint]).are_satisfied(positions) == expected


def test_a_joint_without_ends_is_compared_the_short_way_round() -> None:
    positions = np.array([3.1])
    assert JointConstraint("turn", 0, -3.1, 0.2, 0.2, is_continuous=True).evaluate(positions).satisfied
    assert not JointConstraint("turn", 0, -3.1, 0.2, 0.2, is_continuous=False).evaluate(positions).satisfied


def upright(model: RobotModel, kind: Parameterization, frame: FrameOnRobot) -> OrientationConstraint:
    return OrientationConstraint(
        on_link(model), frame, np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.1, 2 * np.pi]), kind
    )


@pytest.mark.parametrize("kind", Parameterization)
def test_random_states_are_projected_upright_and_stay_within_bounds(model: RobotModel, kind: Parameterization) -> None:
    rng = np.random.default_rng(3)
    indices = model.group("arm_and_manipulator").indices
    constraints = KinematicConstraints(model, orientations=[upright(model, kind, WORLD)])
    solved = 0
    for _ in range(100):
        start = random_state(model, rng)
        found = constraints.project(start, indices)
        if found is None:
            continue
        solved += 1
        axis = model.link_transforms(found)[TIP].rotation[:, 2]
        assert np.arccos(np.clip(-axis[2], -1.0, 1.0)) < 0.1 * np.sqrt(2.0) + 1e-6
        assert not model.bound_violations(found, indices)
        rest = np.setdiff1d(np.arange(len(start)), indices)
        assert (found[rest] == start[rest]).all()
    assert solved >= 95


def test_a_pose_within_tolerances_of_goals_is_found_from_one_nearby(model: RobotModel) -> None:
    """The rotation is right at the start: a step towards the position must not turn the link away for the next step."""
    rng = np.random.default_rng(5)
    indices = model.group("arm_and_manipulator").indices
    solved = 0
    for _ in range(50):
        goal = random_state(model, rng)
        start = goal.copy()
        start[indices] += rng.uniform(-0.15, 0.15, len(indices))
        start[indices] = np.clip(start[indices], model.lower[indices], model.upper[indices])
        wanted, turned = model.link_transforms(goal)[TIP], model.link_transforms(start)[TIP].rotation
        spot = (SphereSolid(1e-4), pin.SE3(np.eye(3), wanted.translation))
        constraints = KinematicConstraints(
            model,
            positions=[PositionConstraint(on_link(model), np.zeros(3), WORLD, (spot,))],
            orientations=[OrientationConstraint(on_link(model), WORLD, turned, np.full(3, 1e-3))],
        )
        found = constraints.project(start, indices)
        if found is not None:
            solved += 1
            reached = model.link_transforms(found)[TIP]
            assert np.linalg.norm(reached.translation - wanted.translation) < 1.1e-4
            assert np.linalg.norm(pin.log3(turned.T @ reached.rotation)) < 2e-3
    assert solved >= 40, solved  # some of these poses are out of reach


def test_a_state_that_satisfies_is_left_where_it_is(model: RobotModel) -> None:
    constraints = KinematicConstraints(model, orientations=[upright(model, Parameterization.ROTATION_VECTOR, WORLD)])
    indices = model.group("arm_and_manipulator").indices
    kept = constraints.sample(np.random.default_rng(4), model.default_positions(), indices)
    assert kept is not None
    again = constraints.project(kept, indices)
    assert again is not None and (again == kept).all()


def test_all_kinds_together_are_met_and_joints_keep_their_tolerance(model: RobotModel) -> None:
    rng = np.random.default_rng(5)
    indices = model.group("arm_and_manipulator").indices
    pan = int(indices[0])
    region = pin.SE3(np.eye(3), np.array([0.4, 0.2, 1.3]))
    constraints = KinematicConstraints(
        model,
        [JointConstraint(model.joint_names[pan], pan, 0.5, 0.4, 0.4)],
        [PositionConstraint(on_link(model), np.zeros(3), WORLD, ((BoxSolid(0.2, 0.2, 0.2), region),))],
        [upright(model, Parameterization.XYZ_EULER_ANGLES, WORLD)],
    )
    for _ in range(20):
        found = constraints.sample(rng, model.default_positions(), indices)
        assert found is not None and constraints.are_satisfied(found)
        assert 0.1 - 1e-6 <= found[pan] <= 0.9 + 1e-6
        assert np.abs(model.link_transforms(found)[TIP].translation - region.translation).max() <= 0.1 + 1e-6
        assert constraints.describe(found) == ""


def test_a_moving_frame_moves_the_constraint_with_it(model: RobotModel) -> None:
    forearm = on_link(model, "forearm_link")
    point = PositionConstraint(on_link(model), np.zeros(3), forearm, ((SphereSolid(0.02), pin.SE3.Identity()),))
    indices = model.group("arm_and_manipulator").indices
    positions = model.default_positions()
    at = model.link_transforms(positions)
    pose = at["forearm_link"].actInv(at[TIP])
    kept = KinematicConstraints(
        model, positions=[PositionConstraint(on_link(model), np.zeros(3), forearm, ((SphereSolid(0.02), pose),))]
    )
    assert kept.are_satisfied(positions)
    positions[indices[0]] += 1.0
    assert kept.are_satisfied(positions), "the joint before the frame turns both"
    positions[indices[3]] += 1.0
    assert not kept.are_satisfied(positions)
    assert "m outside its region" in kept.describe(positions)
    found = kept.project(positions, indices)
    assert found is not None
    now = model.link_transforms(found)
    assert np.linalg.norm(now["forearm_link"].actInv(now[TIP]).translation - pose.translation) <= 0.02 + 1e-6
    assert KinematicConstraints(model, positions=[point]).project(positions, indices) is None, "the arm cannot fold so"


def test_contradicting_joint_constraints_have_no_state(model: RobotModel) -> None:
    pan = int(model.group("arm_and_manipulator").indices[0])
    both = KinematicConstraints(model, [JointConstraint("pan", pan, value, 0.1, 0.1) for value in (0.0, 1.0)])
    assert both.project(model.default_positions(), [pan]) is None
    assert both.sample(np.random.default_rng(0), model.default_positions(), [pan]) is None
