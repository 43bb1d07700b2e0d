# SPDX-License-Identifier: BSD-3-Clause
"""The compiled RRT-Connect: its paths are free by plain Coal, a seed repeats them, and it ends when it has to."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from plain_coal_checker import PlainCoalChecker
from test_collision_checkers import SHAPES, SMALL_SRDF, SMALL_URDF

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    FOUND_FREE,
    FOUND_TOUCHING,
    REQUESTED,
)
from modular_framework_planning.geometry.shapes import Box, Mesh, Plane, Shape
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.rrt_connect import compiled_rrt_connect, rrt_connect
from modular_framework_planning.planners.rrt_connect.rrt_connect import (
    ParallelSearch,
    RrtConnect,
    TreeGrowth,
    can_search,
    reaches,
)
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.planning_interface.planning_request import JointGoal, PipelineSettings, PlanningRequest
from modular_framework_planning.planning_pipeline.trajectory_validator import TrajectoryValidator
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

START = np.array([0.0, 1.2, 0.3, 0.03])
GOAL = np.array([2.0, 1.2, 0.3, 0.07])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.03])
UNREACHABLE = np.array([2.0, 2.5, 2.5, 0.03])  # the arm touches itself
STEP, RANGE = 0.02, 0.5
GROWTH = TreeGrowth(check_step=STEP, max_extension=RANGE)
WALL = (Box(0.9, 0.04, 0.6), np.array([0.35, 0.45, 0.3]))  # between start and goal; the arm goes over it
COVER = (Box(0.9, 0.9, 0.02), np.array([0.0, 0.0, 0.95]))


@pytest.fixture(scope="module")
def small() -> RobotModel:
    group = '<group name="all"><joint name="pan"/><joint name="lift"/><joint name="bend"/><joint name="slide"/></group>'
    return RobotModel(SMALL_URDF, SMALL_SRDF.replace("</robot>", f"{group}</robot>"))


def scene_with(model: RobotModel, *walls: tuple[Shape, np.ndarray]) -> PlanningScene:
    scene = empty_scene(model)
    for number, (shape, at) in enumerate(walls):
        pose = pin.SE3(np.eye(3), at)
        scene = scene.with_object(CollisionObject(f"wall{number}", pose, ((shape, pin.SE3.Identity()),)))
    return scene


def problem_in(
    scene: PlanningScene,
    seed: int = 1,
    seconds: float = 60.0,
    cancelled: Callable[[], bool] = lambda: False,
    start: np.ndarray = START,
    goal: np.ndarray = GOAL,
) -> PlanningProblem:
    model, group = scene.model, scene.model.group("all")
    positions = model.merge(scene.positions, dict(zip(group.joints, start.tolist(), strict=True)))
    scene = scene.with_positions(positions)
    checker = ExactCollisionChecker(scene, group.indices)
    target = JointGoal(dict(zip(group.joints, goal.tolist(), strict=True)))
    now_s = time.monotonic()
    return PlanningProblem(
        request=PlanningRequest(
            scene, "all", (target,), planner_id="RRTConnect", attempts=1, allowed_time_s=seconds, cancelled=cancelled
        ),
        model=model,
        group=group,
        start=positions,
        checker=checker,
        motion=MotionChecker(checker, group.indices, positions),
        kinematics=KinematicsPool(model),
        settings=PipelineSettings(),
        max_velocity=np.ones(len(start)),
        max_acceleration=np.ones(len(start)),
        rng=np.random.default_rng(seed),
        start_time_s=now_s,
        deadline_s=now_s + seconds,
        end_s=now_s + seconds,
        solution_validator=TrajectoryValidator(),
        planner_id="RRTConnect",
    )


def search(problem: PlanningProblem, limit: int | None = None, goal: np.ndarray = GOAL) -> RrtConnect:
    assert can_search(problem)
    return RrtConnect(problem, goal[None], replace(GROWTH, extension_limit=limit))


@pytest.mark.parametrize("is_weighted", [False, True])
def test_a_path_round_a_wall_joins_start_and_goal_by_edges_that_plain_coal_calls_free(
    small: RobotModel, is_weighted: bool
) -> None:
    problem = problem_in(scene_with(small, WALL, COVER))
    plain = PlainCoalChecker(problem.scene, problem.group.indices)
    straight = problem.motion.full_path(np.array([START, GOAL]))
    assert not plain.path_is_free(straight, STEP), "the straight way is blocked"
    path = RrtConnect(problem, GOAL[None], replace(GROWTH, is_weighted=is_weighted)).run()
    assert path is not None
    assert np.array_equal(path[0], START) and np.array_equal(path[-1], GOAL)
    longest = np.linalg.norm(np.diff(path, axis=0), axis=1).max()
    assert longest > RANGE + 0.001 if is_weighted else longest <= RANGE + 1e-12
    full = problem.motion.full_path(path)
    follower, leader = (small.joint_names.index(name) for name in ("follow", "slide"))
    assert np.array_equal(full[:, follower], full[:, leader])
    assert plain.path_is_free(full, STEP)


def test_a_seed_repeats_the_path_and_another_one_gives_another(small: RobotModel) -> None:
    scene = scene_with(small, WALL, COVER)
    one, again, other = (search(problem_in(scene, seed)).run() for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert other is not None and not np.array_equal(one, other)


@pytest.mark.parametrize("count", [2, 4])
def test_of_searches_side_by_side_the_first_path_wins_whatever_the_threads_do(small: RobotModel, count: int) -> None:
    scene = scene_with(small, WALL, COVER)
    plain = PlainCoalChecker(scene, small.group("all").indices)

    def searches(seed: int) -> ParallelSearch:
        problem = problem_in(scene, seed)
        generators = [problem.rng, *problem.rng.spawn(count - 1)]
        return ParallelSearch(
            problem,
            [
                RrtConnect(replace(problem, rng=rng), GOAL[None], GROWTH, search_index=index)
                for index, rng in enumerate(generators)
            ],
        )

    fewer = 0
    for seed in range(6):
        together, again, alone = searches(seed), searches(seed), search(problem_in(scene, seed))
        path = together.run()
        assert path is not None and np.array_equal(path, again.run()) and together.checks == again.checks
        assert alone.run() is not None
        assert plain.path_is_free(problem_in(scene).motion.full_path(path), STEP)
        fewer += together.checks < count * alone.checks
        assert together.checks <= count * (alone.checks + compiled_rrt_connect.EDGES_PER_CALL)
    assert fewer > 0, "some search other than the first one found its path earlier"


def cube_beside_a_wall(gap: float, seed: int) -> PlanningProblem:
    """A cube slides in a plane, one corner `gap` [m] away from a wall, past a pillar behind it."""
    half = 0.8
    turn = pin.Quaternion.FromTwoVectors(np.ones(3), np.array([1.0, 0.0, 0.0])).toRotationMatrix()
    roll, pitch, yaw = pin.rpy.matrixToRpy(turn)
    joints = "".join(
        f'<joint name="{axis}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{xyz}"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        for axis, parent, child, xyz in (("y", "base", "rail", "0 1 0"), ("z", "rail", "cube", "0 0 1"))
    )
    model = RobotModel(
        f'<robot name="slide"><link name="base"/><link name="rail"/>{joints}<link name="cube"><collision>'
        f'<origin rpy="{roll} {pitch} {yaw}" xyz="0 0 0"/><geometry><box size="{2 * half} {2 * half} {2 * half}"/>'
        "</geometry></collision></link></robot>",
        '<robot name="slide"><group name="all"><joint name="y"/><joint name="z"/></group></robot>',
    )
    corner = np.sqrt(3.0) * half
    wall = Box(1.0, 8.0, 8.0), np.array([corner + gap + 0.5, 0.0, 0.0])
    scene = scene_with(model, wall, (Box(0.02, 0.1, 0.3), np.array([0.05 - corner, 0.0, 0.0])))
    return problem_in(scene, seed, start=np.array([-0.8, 0.0]), goal=np.array([0.8, 0.0]))


def test_of_searches_side_by_side_the_same_one_wins_whatever_edges_the_bounds_leave_open() -> None:
    growth = TreeGrowth(check_step=0.002, max_extension=0.02, is_weighted=False)
    for seed in range(8):
        paths, undecided = [], []
        for gap in (5.0e-6, 5.0e-3):  # the bounds leave edges open beside the near wall only
            problem = cube_beside_a_wall(gap, seed)
            searches = [
                RrtConnect(replace(problem, rng=rng), np.array([[0.8, 0.0]]), growth, search_index=index)
                for index, rng in enumerate([problem.rng, *problem.rng.spawn(3)])
            ]
            paths.append(ParallelSearch(problem, searches).run())
            counts = problem.checker.check_counts
            undecided.append(int(counts[REQUESTED] - counts[FOUND_FREE] - counts[FOUND_TOUCHING]))
        assert undecided[0] > 10 * undecided[1], "the near wall leaves far more edges open"
        assert paths[0] is not None and np.array_equal(paths[0], paths[1]), seed


def test_searches_side_by_side_end_with_the_time_and_when_cancelled(small: RobotModel) -> None:
    scene, asked = scene_with(small, WALL, COVER), [0]

    def cancelled() -> bool:
        asked[0] += 1
        return asked[0] > 3

    for problem in (problem_in(scene, seconds=0.2), problem_in(scene, cancelled=cancelled)):
        both = [
            RrtConnect(replace(problem, rng=rng), UNREACHABLE[None], GROWTH, search_index=index)
            for index, rng in enumerate(problem.rng.spawn(2))
        ]
        assert ParallelSearch(problem, both).run() is None


def test_the_reach_of_a_joint_bounds_how_far_it_moves_what_it_carries(small: RobotModel) -> None:
    checker = ExactCollisionChecker(scene_with(small, WALL))
    assert checker.compiled_world is not None
    bounds = dict(zip(small.joint_names, reaches(checker.compiled_world), strict=True))
    assert bounds["slide"] == bounds["follow"] == 1.0
    rng, data = np.random.default_rng(3), small.pin_model.createData()
    for joint in ("pan", "lift", "bend"):
        index, moved = small.joint_names.index(joint), 0.0
        for _ in range(200):
            states = np.tile(small.with_mimics(rng.uniform(small.lower, small.upper)), (2, 1))
            states[1, index] += 1.0e-4
            points = []
            for state in states:
                pin.forwardKinematics(small.pin_model, data, state)
                points.append(
                    [(data.oMi[item.joint_id] * item.placement).translation for item in small.link_geometries]
                )
            moved = max(moved, float(np.linalg.norm(np.diff(points, axis=0), axis=-1).max()) / 1.0e-4)
        assert 0.7 * bounds[joint] < moved <= bounds[joint], joint


class CountingMotion(MotionChecker):
    """Counts the edges that it is asked about."""

    asked = 0

    def edge_is_free(self, start: np.ndarray, end: np.ndarray, step: float) -> bool:
        self.asked += 1
        return super().edge_is_free(start, end, step)


def test_an_edge_too_close_for_the_bounds_is_decided_by_the_exact_check(small: RobotModel) -> None:
    top = 0.1 + 0.25 + 0.45 + 0.38 + 0.05  # of the finger when the arm is upright [m]
    cover = COVER[0], np.array([0.0, 0.0, top + 0.01 + 2.0e-6])  # so near to it that the bounds do not decide
    problem = problem_in(scene_with(small, cover))
    motion = CountingMotion(problem.checker, problem.group.indices, problem.start)
    path = search(replace(problem, motion=motion), goal=UPRIGHT).run()
    assert path is not None and np.array_equal(path[-1], UPRIGHT)
    assert motion.asked > 0


def test_a_goal_that_cannot_be_reached_ends_the_search_at_its_limit(small: RobotModel) -> None:
    few, many = (search(problem_in(scene_with(small, WALL)), limit, UNREACHABLE) for limit in (50, 500))
    assert few.run() is None and many.run() is None
    assert 50 <= few.checks < many.checks


def test_trees_that_become_too_large_for_their_arrays_are_grown_on(
    small: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_with(small, WALL, COVER)
    path = search(problem_in(scene)).run()
    monkeypatch.setattr(rrt_connect, "INITIAL_TREE_CAPACITY", 2)
    assert path is not None and np.array_equal(search(problem_in(scene)).run(), path)


def test_a_held_body_without_an_end_does_not_count_in_the_reach(small: RobotModel) -> None:
    body = CollisionObject("sheet", pin.SE3.Identity(), ((Plane(0.0, 0.0, 1.0, 0.0), pin.SE3.Identity()),))
    corners = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]])
    peak = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    scene = scene_with(small, (peak, np.array([0.0, 0.0, 3.0])))
    world = ExactCollisionChecker(scene.with_attached(AttachedObject(body, "finger", frozenset(SHAPES)))).compiled_world
    assert world is not None and np.isinf(world.spheres[:, 3]).any()
    assert np.isfinite(reaches(world)).all()


def test_a_checker_with_a_path_check_of_its_own_is_asked_and_not_gone_round(small: RobotModel) -> None:
    class Own(ExactCollisionChecker):
        def path_is_free(self, vertices: np.ndarray, step: float, first: int = 0) -> bool:
            return super().path_is_free(vertices, step, first)

    problem = problem_in(scene_with(small, WALL))
    assert can_search(problem)
    assert not can_search(replace(problem, checker=Own(problem.scene, problem.group.indices)))


def test_the_clock_and_a_cancellation_end_the_search(small: RobotModel) -> None:
    scene = scene_with(small, WALL)
    start_time_s = time.monotonic()
    assert search(problem_in(scene, seconds=0.3), goal=UNREACHABLE).run() is None
    assert 0.3 <= time.monotonic() - start_time_s < 5.0
    start_time_s = time.monotonic()
    answers = iter([False] * 3 + [True] * 10)
    assert search(problem_in(scene, cancelled=lambda: next(answers)), goal=UNREACHABLE).run() is None
    assert len(list(answers)) < 10 and time.monotonic() - start_time_s < 5.0


def test_the_smaller_tree_extends_until_it_is_as_large_as_the_other_one(small: RobotModel) -> None:
    closed = search(problem_in(scene_with(small)), 60, UNREACHABLE)  # no state next to this goal is free
    assert closed.run() is None
    assert closed.tree_sizes == (2, 1), "the start's tree waits for that of the goal"
