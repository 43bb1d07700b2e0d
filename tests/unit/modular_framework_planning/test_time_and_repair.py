# SPDX-License-Identifier: BSD-3-Clause
"""A path that collides between the states a search looked at is repaired; messages name what failed."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constrained_motion import ConstrainedMotion
from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot, OrientationConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box, Mesh
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.ompl.planner import OmplPlanner, connection
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner
from modular_framework_planning.planning_interface.goals import GoalResolver
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.path_repair import EdgeError, repair_path
from modular_framework_planning.planning_interface.phase_times import PhaseTimes
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem, no_path
from modular_framework_planning.planning_interface.planning_request import JointGoal, PipelineSettings, PlanningRequest
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.plugins import make_adapters
from modular_framework_planning.planning_pipeline.trajectory_validator import GRACE_S, TrajectoryValidator
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_testing.planning.independent_checker import IndependentChecker, box

GROUP = "arm_and_manipulator"
START = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
GOAL = (-0.4, -1.57, 1.2, -1.2, -1.57, 0.0)
THIN = np.array([0.01, 0.8, 0.5])  # [m]; a board the arm swings through between two coarse samples
BOARD_AT = np.array([0.35, 0.5, 1.25])


@pytest.fixture(scope="module")
def pool(model: RobotModel) -> KinematicsPool:
    return KinematicsPool(model)


def at_start(model: RobotModel, scene: PlanningScene) -> PlanningScene:
    return scene.with_positions(model.merge(scene.positions, dict(zip(model.group(GROUP).joints, START, strict=True))))


def request(model: RobotModel, values: tuple[float, ...] = GOAL, board: bool = True) -> PlanningRequest:
    scene = empty_scene(model)
    if board:
        scene = scene.with_object(
            CollisionObject("board", pin.SE3(np.eye(3), BOARD_AT), ((Box(*THIN), pin.SE3.Identity()),))
        )
    goal = JointGoal(dict(zip(model.group(GROUP).joints, values, strict=True)))
    return PlanningRequest(
        at_start(model, scene), GROUP, (goal,), planner_id="RRTConnect", attempts=1, allowed_time_s=60.0
    )


class Coarse(OmplPlanner):
    """Goes straight through everything, as a search whose samples all miss the board."""

    def __init__(self) -> None:
        self.asked: list[PlanningProblem] = []

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        self.asked.append(problem)
        return PlannedPath(np.vstack([problem.start_values, problem.goal_states()[0]]))


class Stubborn(Coarse):
    """Finds no way round."""

    @staticmethod
    def repair_path(problem: PlanningProblem, vertices: np.ndarray) -> np.ndarray:
        return repair_path(problem, vertices, lambda *_: None)


def test_a_colliding_edge_is_repaired_and_the_search_is_not_begun_again(
    model: RobotModel, robot: object, pool: KinematicsPool
) -> None:
    planner, asked = Coarse(), request(model)
    answer = PlanningPipeline(pool, PipelineSettings(seed=1), planner, adapters=make_adapters()).plan(asked)
    assert len(planner.asked) == 1 and len(answer.path) > 2
    second = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
    second.set_world([("board", box(*THIN), pin.SE3(np.eye(3), BOARD_AT).homogeneous)])
    rest = dict(zip(model.joint_names, answer.start.tolist(), strict=True))
    motion = answer.trajectory
    assert second.colliding_states(motion.joint_names, np.array([START, GOAL]), rest), "the straight way is blocked"
    assert not second.colliding_states(motion.joint_names, motion.positions, rest, 0.005)
    assert np.allclose(motion.positions[-1], GOAL)


def test_what_could_not_be_repaired_is_named_with_bodies_and_state(model: RobotModel, pool: KinematicsPool) -> None:
    with pytest.raises(PlanningError) as caught:
        PlanningPipeline(pool, PipelineSettings(seed=1), Stubborn(), adapters=make_adapters()).plan(request(model))
    assert caught.value.code == ErrorCode.INVALID_MOTION_PLAN
    for word in ("edge 1 of 1", "'board'", "mm deep", "shoulder_pan_joint"):
        assert word in caught.value.reason, caught.value.reason


def test_a_later_search_without_a_path_does_not_hide_what_the_first_one_failed_by(
    model: RobotModel, pool: KinematicsPool
) -> None:
    class Once(Stubborn):
        def plan(self, problem: PlanningProblem) -> PlannedPath:
            if self.asked:
                raise no_path(problem, "Once", 7)
            return super().plan(problem)

    with pytest.raises(PlanningError, match="Once found no path.*a path was found before, but edge 1 of 1.*'board'"):
        PlanningPipeline(pool, PipelineSettings(seed=1), Once(), adapters=make_adapters()).plan(request(model))


def test_the_planner_leaves_time_for_the_check_and_no_message_counts_from_a_later_begin(
    model: RobotModel, pool: KinematicsPool
) -> None:
    planner = Coarse()
    PlanningPipeline(pool, PipelineSettings(seed=1), planner, adapters=make_adapters()).plan(
        request(model, board=False)
    )
    problem = planner.asked[0]
    assert problem.start_time_s < problem.deadline_s < problem.end_s == pytest.approx(problem.start_time_s + 60.0)
    assert problem.end_s - problem.deadline_s == pytest.approx(0.25)
    improving = Coarse()
    PlanningPipeline(pool, PipelineSettings(seed=1), improving, adapters=make_adapters()).plan(
        replace(request(model, board=False), planner_id="BITstar")
    )
    assert improving.asked[0].end_s - improving.asked[0].deadline_s == pytest.approx(1.0), "it always uses all its time"
    late = replace(problem, start_time_s=time.monotonic() - 60.0, deadline_s=time.monotonic() - 0.3)
    error = no_path(late, "BITstar", 5)
    assert error.code == ErrorCode.TIMED_OUT and "in 60.0" in error.reason and "time ran out after 5" in error.reason
    early = no_path(problem, "FMT", 5)
    assert early.code == ErrorCode.PLANNING_FAILED and "time ran out" not in early.reason


def test_a_check_does_not_go_on_long_after_the_allowed_time() -> None:
    motion = parameterize(("a",), np.array([[0.0], [1.0]]), np.zeros(0), np.ones(1), np.ones(1))
    looked: list[float] = []
    problem = SimpleNamespace(
        settings=PipelineSettings(),
        constraints=None,
        phases=PhaseTimes(),
        checker=None,
        cancelled=lambda: False,
        end_s=time.monotonic() - GRACE_S - 1.0,
        request=SimpleNamespace(allowed_time_s=2.0),
        motion=SimpleNamespace(colliding_state=lambda line, step: looked.append(step)),
    )
    with pytest.raises(PlanningError, match="unchecked motion is not returned") as caught:
        TrajectoryValidator().fault(problem, PlannedPath(motion.positions, motion))
    assert caught.value.code == ErrorCode.TIMED_OUT and not looked


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_goal_a_hair_beyond_a_bound_ends_on_the_bound(model: RobotModel, pool: KinematicsPool, side: float) -> None:
    joint = model.group(GROUP).indices[-1]
    bound = float(model.upper[joint] if side > 0.0 else model.lower[joint])
    pipeline = PipelineSpec(settings=PipelineSettings(seed=1)).build(model, pool)
    for beyond in (5.0e-7, 9.0e-5):
        answer = pipeline.plan(request(model, (*START[:5], bound + side * beyond), board=False))
        assert answer.trajectory.positions[-1, 5] == bound
    with pytest.raises(PlanningError, match="wrist_3_joint.*is outside") as caught:
        pipeline.plan(request(model, (*START[:5], bound + side * 3.0e-4), board=False))
    assert caught.value.code == ErrorCode.GOAL_STATE_INVALID


def test_industrial_motions_in_collision_are_invalid_motion_plans(model: RobotModel, pool: KinematicsPool) -> None:
    pipeline = PlanningPipeline(pool, PipelineSettings(), CommandPlanner(None), adapters=())
    inside = request(model)
    tip = model.link_transforms(
        model.merge(inside.scene.positions, dict(zip(model.group(GROUP).joints, GOAL, strict=True)))
    )["wrist_2_link"].translation
    start = model.link_transforms(inside.scene.positions)["wrist_2_link"].translation
    for where, words in (
        (tip, "goal is in collision"),
        (start, "start state is in collision"),
        (BOARD_AT, "final validation"),
    ):
        block = CollisionObject("block", pin.SE3(np.eye(3), where), ((Box(0.05, 0.05, 0.05), pin.SE3.Identity()),))
        scene = empty_scene(model, inside.scene.positions)
        scene = scene.with_object(block) if words != "final validation" else inside.scene
        with pytest.raises(PlanningError, match=words) as caught:
            pipeline.plan(replace(inside, scene=scene, planner_id="PTP"))
        assert caught.value.code == ErrorCode.INVALID_MOTION_PLAN, words


def test_every_edge_of_a_repaired_path_is_free(model: RobotModel, pool: KinematicsPool) -> None:
    planner = Coarse()
    asked = request(model)
    PlanningPipeline(pool, PipelineSettings(seed=1), planner, adapters=make_adapters()).plan(asked)
    problem = planner.asked[0]
    way = OmplPlanner().repair_path(problem, np.array([START, GOAL, START]))
    checker = ExactCollisionChecker(asked.scene, problem.group.indices)
    assert checker.path_is_free(problem.motion.full_path(way), problem.settings.finest_step)
    assert np.allclose(way[0], START) and (np.abs(way - GOAL).max(axis=1) < 1e-9).any()
    with pytest.raises(EdgeError, match="edge 1 of 2"):
        Stubborn.repair_path(problem, np.array([START, GOAL, START]))


def test_the_search_round_an_edge_under_constraints_does_not_depend_on_the_clock(
    model: RobotModel, pool: KinematicsPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps_towards = ConstrainedMotion.steps_towards
    delay_s, looked = 0.0, 0

    def watched(self: ConstrainedMotion, *arguments: Any) -> Any:
        nonlocal looked
        looked += 1
        time.sleep(delay_s)  # as on a busy computer
        return steps_towards(self, *arguments)

    monkeypatch.setattr(ConstrainedMotion, "steps_towards", watched)
    planner = Coarse()
    PlanningPipeline(pool, PipelineSettings(seed=1), planner, adapters=make_adapters()).plan(
        request(model, board=False)
    )
    problem = planner.asked[0]
    tip = problem.group.tip_link
    frame = model.pin_model.frames[model.frame_ids[tip]]
    level = OrientationConstraint(
        FrameOnRobot(tip, int(frame.parentJoint), frame.placement.copy()),
        FrameOnRobot("world", 0, pin.SE3.Identity()),
        model.link_transforms(problem.start)[tip].rotation,
        np.array([0.02, 0.02, 0.02]),
    )
    tilted = np.array([*START[:4], -1.0, 0.0])  # it violates the constraint, so that no way leads there
    steps = []
    for slowness_s in (0.0, 0.02):
        delay_s, looked = slowness_s, 0
        own = replace(
            problem,
            constraints=KinematicConstraints(model, orientations=[level]),
            repeatable=True,
            rng=np.random.default_rng(3),
        )
        assert connection(own, np.array(START), tilted) is None
        steps.append(looked)
    assert steps[0] == steps[1] > 10


def sphere_mesh(subdivisions: int) -> Mesh:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.1)
    return Mesh(np.asarray(ball.vertices, dtype=float), np.asarray(ball.faces, dtype=np.int64))


def test_the_allowed_time_covers_building_the_world_and_what_was_built_is_kept(
    model: RobotModel, pool: KinematicsPool
) -> None:
    asked = request(model, board=False)
    meshes = [sphere_mesh(3) for _ in range(3)]
    scene = asked.scene
    for number, mesh in enumerate(meshes):
        at = pin.SE3(np.eye(3), np.array([1.5, 0.3 * number, 1.0]))
        scene = scene.with_object(CollisionObject(f"ball{number}", at, ((mesh, pin.SE3.Identity()),)))
    pipeline = PipelineSpec(settings=PipelineSettings(seed=1)).build(model, pool)
    with pytest.raises(PlanningError, match="collision world of 3 objects was not built") as caught:
        pipeline.plan(replace(asked, scene=scene, allowed_time_s=1e-6))
    assert caught.value.code == ErrorCode.TIMED_OUT
    assert np.allclose(pipeline.plan(replace(asked, scene=scene)).trajectory.positions[-1], GOAL)
    assert all("geometry" not in vars(mesh) for mesh in meshes), "Coal's tree is not built for what is far away"


def test_of_many_goals_no_more_are_looked_at_than_time_allows(model: RobotModel, pool: KinematicsPool) -> None:
    asked = request(model)
    indices = model.group(GROUP).indices
    checker = ExactCollisionChecker(asked.scene, indices)
    motion = MotionChecker(checker, indices, asked.scene.positions)
    free, hit = (
        request(model, START).goals,
        JointGoal(dict(zip(model.group(GROUP).joints, (1.57, 0.6, 0.0, 0.0, 0.0, 0.0), strict=True))),
    )

    def found(*goals: object) -> np.ndarray:
        return GoalResolver(
            replace(asked, goals=goals),
            pool,
            motion,
            np.random.default_rng(1),
            must_stop=lambda: True,
        ).resolve()

    assert len(found(*free, hit, hit)) == 1
    block = CollisionObject(
        "block", pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])), ((Box(3.0, 3.0, 3.0), pin.SE3.Identity()),)
    )
    checker = ExactCollisionChecker(asked.scene.with_object(block), indices)
    motion = MotionChecker(checker, indices, asked.scene.positions)
    with pytest.raises(PlanningError, match="1 of 3 goals were tried.*'block'") as caught:
        found(hit, hit, *free)
    assert caught.value.code == ErrorCode.TIMED_OUT
