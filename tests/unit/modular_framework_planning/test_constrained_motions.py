# SPDX-License-Identifier: BSD-3-Clause
"""Motions under path constraints: compiled verdicts are those of the single constraints, and whole plans keep them."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_constraints import SOLIDS, TIP, WORLD, on_link, random_state

from modular_framework_planning.constraints.constrained_motion import ConstrainedMotion
from modular_framework_planning.constraints.constraint_kinds import (
    JointConstraint,
    OrientationConstraint,
    Parameterization,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.regions import BoxSolid, Solid, SphereSolid
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planning_request import JointGoal, PipelineSettings, PlanningRequest
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.path_shortening import path_length, shortcut_pieces

GROUP = "arm_and_manipulator"
START = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
SEEDS = st.integers(0, 2**32 - 1)


def at(model: RobotModel, values: tuple[float, ...] = START) -> np.ndarray:
    return model.merge(model.default_positions(), dict(zip(model.group(GROUP).joints, values, strict=True)))


def in_region(model: RobotModel, solid: Solid, pose: pin.SE3) -> KinematicConstraints:
    return KinematicConstraints(
        model, positions=[PositionConstraint(on_link(model), np.zeros(3), WORLD, ((solid, pose),))]
    )


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS)
def test_verdicts_on_a_set_are_those_of_the_single_constraints(model: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions, indices = random_state(model, rng), model.group(GROUP).indices
    tip = model.link_transforms(positions)[TIP]
    offset, width = rng.uniform(-0.1, 0.1, 3), rng.uniform(0.0, 3.0)
    moving = on_link(model, "upper_arm_link")
    frame = rng.choice([WORLD, moving])
    kinds = list(rng.choice(list(SOLIDS), 2))
    regions = tuple(
        (
            SOLIDS[kind],
            model.link_transforms(positions)["upper_arm_link"].inverse()
            * pin.SE3(Rotation.random(rng=rng).as_matrix(), tip.act(offset) + rng.uniform(-0.3, 0.3, 3)),
        )
        for kind in kinds
    )
    number = int(rng.choice(indices))
    constraints = KinematicConstraints(
        model,
        [JointConstraint("", number, float(rng.uniform(-2, 2)), 2.0, 3.0, is_continuous=bool(rng.integers(2)))]
        * int(rng.integers(2)),
        [PositionConstraint(on_link(model), offset, moving, regions)] * int(rng.integers(2)),
        [
            OrientationConstraint(
                on_link(model), frame, Rotation.random(rng=rng).as_matrix(), rng.uniform(0.0, 2.0 * width, 3), kind
            )
            for kind in list(Parameterization)[: int(rng.integers(3))]
        ],
    )
    assert constraints.are_satisfied(positions) == all(item.satisfied for item in constraints.evaluate(positions))


REGIONS = [
    pytest.param(BoxSolid(0.002, 2.0, 2.0), id="plane"),
    pytest.param(BoxSolid(0.002, 0.002, 2.0), id="line"),
    *(pytest.param(solid, id=kind) for kind, solid in SOLIDS.items()),
]


@pytest.mark.parametrize("solid", REGIONS)
def test_a_point_is_brought_into_every_region_from_outside_of_it(model: RobotModel, solid: Solid) -> None:
    rng = np.random.default_rng(6)
    indices, found, outside = model.group(GROUP).indices, 0, 0
    constraints = in_region(model, solid, pin.SE3(Rotation.random(rng=rng).as_matrix(), np.array([0.4, 0.2, 1.3])))
    for _ in range(100):
        start = random_state(model, rng)
        outside += not constraints.are_satisfied(start)
        moved = constraints.project(start, indices)
        if moved is not None:
            found += 1
            assert all(item.satisfied for item in constraints.evaluate(moved))
    assert outside > 50 and found >= 95


@pytest.mark.parametrize("kind", Parameterization)
@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.0])
def test_a_way_keeps_the_constraint_between_its_states_and_arrives_exactly(
    model: RobotModel, kind: Parameterization, tolerance: float
) -> None:
    rng, indices = np.random.default_rng(8), model.group(GROUP).indices
    tilt = OrientationConstraint(
        on_link(model), WORLD, np.diag([1.0, -1.0, -1.0]), np.array([tolerance, tolerance, 7.0]), kind
    )
    constraints = KinematicConstraints(model, orientations=[tilt])
    loose = KinematicConstraints(model, orientations=[replace(tilt, tolerances=tilt.tolerances + 1.0e-5)])
    arrived = 0
    for _ in range(20):
        start = constraints.sample(rng, model.default_positions(), indices)
        near = start.copy()
        near[indices] += rng.uniform(-0.5, 0.5, len(indices))
        end = constraints.project(near, indices)
        if end is None:
            continue
        way = ConstrainedMotion(constraints, indices, start, 0.004, 0.004).connect(start[indices], end[indices])
        if way is None:
            continue
        arrived += 1
        assert np.array_equal(way[0], start[indices]) and np.array_equal(way[-1], end[indices])
        for first, second in zip(way[:-1], way[1:], strict=True):
            for share in np.linspace(0.0, 1.0, 7):
                state = start.copy()
                state[indices] = first + share * (second - first)
                assert loose.are_satisfied(state)
    assert arrived >= 12


def test_a_path_is_cut_along_the_constraint_and_keeps_its_ends() -> None:
    def on_circle(angle: float) -> np.ndarray:
        return np.array([np.cos(angle), np.sin(angle)])

    def way(first: np.ndarray, second: np.ndarray, max_length: float) -> np.ndarray | None:
        begin, end = (np.arctan2(*point[::-1]) for point in (first, second))
        piece = np.vstack([first, [on_circle(angle) for angle in np.linspace(begin, end, 20)], second])
        return piece if path_length(piece) <= max_length else None

    detour = np.vstack([[on_circle(angle) for angle in np.linspace(a, b, 20)] for a, b in ((0.0, 2.0), (2.0, 1.0))])
    short = shortcut_pieces(detour, way, np.inf, np.random.default_rng(1))
    assert np.array_equal(short[0], detour[0]) and np.array_equal(short[-1], detour[-1])
    assert path_length(detour) > 2.9 and path_length(short) < 1.2
    assert np.abs(np.linalg.norm(short, axis=1) - 1.0).max() < 0.01
    assert np.array_equal(shortcut_pieces(detour, lambda *_: None, np.inf, np.random.default_rng(1)), detour)
    assert np.array_equal(shortcut_pieces(detour, way, time.monotonic() - 1.0, np.random.default_rng(1)), detour)


def distance_outside(solid: BoxSolid | SphereSolid, point: np.ndarray) -> float:
    """Distance of a point from a solid."""
    if isinstance(solid, SphereSolid):
        return max(float(np.linalg.norm(point)) - solid.radius, 0.0)
    return float(np.linalg.norm(np.maximum(np.abs(point) - 0.5 * np.array([solid.x, solid.y, solid.z]), 0.0)))


CASES: dict[str, tuple[BoxSolid | SphereSolid, float]] = {
    "plane": (BoxSolid(2.0, 2.0, 0.004), 0.002),
    "line": (BoxSolid(0.004, 2.0, 0.004), 0.002),
    "ball": (SphereSolid(0.35), 0.35),
}


@pytest.mark.parametrize("case", CASES)
def test_the_tip_stays_in_its_region_at_every_millisecond(model: RobotModel, case: str) -> None:
    solid, _ = CASES[case]
    tip = model.link_transforms(at(model))[TIP]
    constraints = in_region(model, solid, pin.SE3(np.eye(3), tip.translation))
    group, scene = model.group(GROUP), empty_scene(model, at(model))
    wanted = at(model)
    wanted[group.indices] += (0.5, 0.15, -0.3, 0.2, 0.3, 1.0)
    goal_state = constraints.project(wanted, group.indices)
    assert goal_state is not None
    goal = JointGoal(dict(zip(group.joints, goal_state[group.indices].tolist(), strict=True)))
    pipeline = PipelineSpec(
        settings=PipelineSettings(default_velocity_scaling_factor=1.0, default_acceleration_scaling_factor=1.0, seed=1)
    )
    answer = pipeline.build(model, KinematicsPool(model)).plan(
        PlanningRequest(scene, GROUP, (goal,), allowed_time_s=30.0, path_constraints=constraints)
    )
    motion = answer.trajectory
    assert np.abs(motion.positions[-1] - goal_state[group.indices]).max() < 1e-6
    for values in motion.positions_at(motion.sample_times()):
        state = answer.start.copy()
        state[group.indices] = values
        point = model.link_transforms(state)[TIP].translation - tip.translation
        assert distance_outside(solid, point) < 1.0e-5


def test_failures_name_the_violated_constraint_and_the_amount(model: RobotModel) -> None:
    tip = model.link_transforms(at(model))[TIP]
    group, pipeline = model.group(GROUP), PipelineSpec(adapters="").build(model, KinematicsPool(model))
    goal = JointGoal(dict(zip(group.joints, (0.57, *START[1:]), strict=True)))
    for shift, code in (
        (0.0, ErrorCode.GOAL_VIOLATES_PATH_CONSTRAINTS),
        (0.3, ErrorCode.START_STATE_VIOLATES_PATH_CONSTRAINTS),
    ):
        region = pin.SE3(np.eye(3), tip.translation + np.array([0.0, 0.0, shift]))
        request = PlanningRequest(
            empty_scene(model, at(model)), GROUP, (goal,), path_constraints=in_region(model, SphereSolid(0.1), region)
        )
        with pytest.raises(PlanningError) as caught:
            pipeline.plan(request)
        assert caught.value.code == code
        amount = (
            float(
                np.linalg.norm(
                    region.translation
                    - model.link_transforms(at(model, (0.57, *START[1:])) if not shift else at(model))[TIP].translation
                )
            )
            - 0.1
        )
        assert f"link '{TIP}' is {amount:.4f} m outside its region" in caught.value.reason
