# SPDX-License-Identifier: BSD-3-Clause
"""What a report says about a plan: counts of each layer against plain Coal, and the sentence about what took long."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from plain_coal_checker import PlainCoalChecker
from test_collision_checkers import SMALL_SRDF, SMALL_URDF
from test_many_solids import random_world
from test_rrt_connect import COVER, GOAL, START, UPRIGHT, WALL, problem_in, scene_with, search

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels.compiled_collision import EXACTLY_TOUCHING, REQUESTED
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.plan_statistics import CheckCounts, PlanStatistics, Refusals
from modular_framework_planning.planners.rrt_connect.rrt_connect import ParallelSearch, RrtConnect, TreeGrowth
from modular_framework_planning.planning_interface.phase_times import SEARCH, SETUP, PhaseTimes
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.reproducible.scene_pickling import from_bytes, to_bytes
from modular_framework_planning.robot_model.robot_model import RobotModel

STATES = 400


@pytest.fixture(scope="module")
def small() -> RobotModel:
    group = '<group name="all"><joint name="pan"/><joint name="lift"/><joint name="bend"/><joint name="slide"/></group>'
    return RobotModel(SMALL_URDF, SMALL_SRDF.replace("</robot>", f"{group}</robot>"))


def refused(counts: np.ndarray) -> int:
    _, _, touching, _, exactly = counts.tolist()
    return touching + exactly


def test_every_check_is_counted_once_and_refused_as_often_as_plain_coal_refuses(small: RobotModel) -> None:
    rng = np.random.default_rng(1)
    scene = random_world(small, rng)
    checker, plain, expected = ExactCollisionChecker(scene), PlainCoalChecker(scene), 0
    for _ in range(STATES):
        state = small.with_mimics(rng.uniform(small.lower, small.upper))
        checker.is_free(state)
        expected += not plain.is_free(state)
    assert 0 < expected < STATES
    asked, free, touching, looked_at, exactly = checker.check_counts.tolist()
    assert asked == looked_at == STATES, "a state is one look"
    assert refused(checker.check_counts) == expected
    assert free + exactly <= STATES - touching


def test_the_two_bodies_named_are_those_that_touch_most_often(small: RobotModel) -> None:
    rng = np.random.default_rng(2)
    scene = random_world(small, rng)
    checker, plain, expected = ExactCollisionChecker(scene), PlainCoalChecker(scene), Counter[frozenset[str]]()
    assert checker.most_frequent_contact() is None
    while sum(expected.values()) < 60:
        state = small.with_mimics(rng.uniform(small.lower, small.upper))
        found = plain.contacts(state)
        if len(found) == 1:  # of several any one may be met first
            expected[frozenset((found[0].first.name, found[0].second.name))] += 1
            assert not checker.is_free(state)
    most = checker.most_frequent_contact()
    assert most is not None
    assert expected[frozenset((most.first, most.second))] == most.checks == max(expected.values())


def test_an_edge_that_the_bounds_leave_open_counts_as_undecided_and_once(small: RobotModel) -> None:
    top = 0.1 + 0.25 + 0.45 + 0.38 + 0.05  # of the finger when the arm is upright [m]
    near = COVER[0], np.array([0.0, 0.0, top + 0.01 + 2.0e-6])
    problem = problem_in(scene_with(small, near))
    assert search(problem, goal=UPRIGHT).run() is not None
    asked, free, touching, _, exactly = problem.checker.check_counts.tolist()
    assert asked > free + touching, "some edge was undecided"
    assert exactly <= asked - free - touching
    before = problem.checker.check_counts.copy()
    touching_plate = scene_with(small, (COVER[0], np.array([0.0, 0.0, top + 0.01 - 1.0e-9])))
    checker = ExactCollisionChecker(touching_plate, problem.group.indices)
    assert not checker.is_free(problem.motion.full_positions(UPRIGHT))
    assert refused(checker.check_counts) == checker.check_counts[REQUESTED] == 1
    assert np.array_equal(before, problem.checker.check_counts), "each checker counts for itself"


def test_searches_side_by_side_are_counted_together(small: RobotModel) -> None:
    problem = problem_in(scene_with(small, WALL, COVER))
    growth = TreeGrowth(check_step=0.02, max_extension=0.5)
    searches = [
        RrtConnect(replace(problem, rng=rng), GOAL[None], growth, search_index=index)
        for index, rng in enumerate([problem.rng, *problem.rng.spawn(2)])
    ]
    both = ParallelSearch(problem, searches)
    assert both.run() is not None
    assert problem.checker.check_counts[REQUESTED] == both.checks
    assert problem.checker.check_counts[EXACTLY_TOUCHING] <= both.checks


def test_a_part_inside_another_one_counts_for_itself(small: RobotModel) -> None:
    checker, phases = ExactCollisionChecker(scene_with(small, WALL)), PhaseTimes()
    state = small.with_mimics(np.zeros(len(small.joint_names)))
    with phases.measure(SETUP):
        checker.is_free(state)
        phases.watch(checker)
    with phases.measure(SEARCH):
        checker.is_free(state)
        with phases.measure(SETUP):
            checker.is_free(state)
            checker.is_free(state)
    checks = phases.statistics().checks
    assert (checks[SETUP].asked, checks[SEARCH].asked) == (3, 1)


def test_a_checker_that_does_not_count_has_times_alone(small: RobotModel) -> None:
    phases = PhaseTimes()
    phases.watch(PlainCoalChecker(scene_with(small, WALL)))
    with phases.measure(SEARCH):
        pass
    assert not phases.statistics().checks and set(phases.statistics().phases_s) == {SEARCH}


def pipeline_request(model: RobotModel, goal: np.ndarray, time_s: float = 20.0) -> PlanningRequest:
    scene, group = scene_with(model, WALL, COVER), model.group("all")
    start = model.merge(scene.positions, dict(zip(group.joints, START.tolist(), strict=True)))
    target = JointGoal(dict(zip(group.joints, goal.tolist(), strict=True)))
    return PlanningRequest(
        scene.with_positions(start), "all", (target,), planner_id="RRTConnect", attempts=1, allowed_time_s=time_s
    )


def test_a_plan_and_a_failed_one_say_what_they_took_also_to_another_process(small: RobotModel) -> None:
    pipeline = PipelineSpec(settings=PipelineSettings(seed=3)).build(small, KinematicsPool(small))
    answer = pipeline.plan(pipeline_request(small, GOAL))
    report = json.loads(json.dumps(answer.statistics.as_json()))
    assert report["checks"]["search"]["asked"] > 0 and report["checks"]["shortening"]["states"] > 0
    for counts in report["checks"].values():
        assert counts["asked"] == counts["free_by_bounds"] + counts["touching_by_bounds"] + counts["undecided"]
    assert report["summary"].split(" ")[0] == max(report["phases_s"], key=lambda name: report["phases_s"][name])
    assert {report["refusals"]["first"], report["refusals"]["second"]} & {"wall0", "wall1"}
    with pytest.raises(PlanningError) as failed:
        pipeline.plan(pipeline_request(small, np.array([2.0, 1.2, 5.0, 0.07])))
    assert failed.value.statistics is not None and failed.value.statistics.phases_s["setup"] > 0.0
    copied = from_bytes(to_bytes(failed.value), small)
    assert copied.statistics == failed.value.statistics


@pytest.mark.parametrize(
    ("asked", "planner", "implementation", "replaced"),
    [
        ("RRTConnect", "RRTConnect", "compiled", ""),
        ("PRM", "PRM", "OMPL", ""),
        ("BKPIECEE", "RRTConnect", "compiled", "BKPIECEE"),
        ("", "RRTConnect", "compiled", ""),
    ],
)
def test_a_plan_says_which_planner_searched_and_what_it_replaced(
    small: RobotModel, asked: str, planner: str, implementation: str, replaced: str
) -> None:
    pipeline = PipelineSpec(settings=PipelineSettings(seed=3)).build(small, KinematicsPool(small))
    request = replace(pipeline_request(small, GOAL, 3.0), planner_id=asked)
    run = pipeline.plan(request).statistics.as_json()["run"]
    assert (run["pipeline"], run["planner"], run["implementation"]) == ("ompl", planner, implementation)
    assert run["replaced"] == replaced
    assert run["collision_checker"].endswith(".exact_collision_checker/ExactCollisionChecker")


def test_a_plan_says_its_settings_and_one_without_a_search_that_none_ran(small: RobotModel) -> None:
    settings = PipelineSettings(seed=3, planner_configs={"mine": {"type": "geometric::RRTConnect", "range": 0.3}})
    pipeline = PipelineSpec(settings=settings).build(small, KinematicsPool(small))
    request = replace(pipeline_request(small, GOAL), planner_id="mine")
    run = pipeline.plan(request).statistics.run
    assert run is not None and run.settings == {"range": 0.3}
    beside = pipeline.plan(replace(request, goals=(JointGoal({"pan": float(START[0]) + 0.01}),))).statistics.run
    assert beside is not None and (beside.planner, beside.implementation) == ("RRTConnect", "")


def test_the_sentence_names_the_longest_part_and_the_bodies_in_the_way() -> None:
    counts = CheckCounts(41_000, 10_000, 26_080, 4_920, 80, 90_000)
    slow = PlanStatistics(
        {"setup": 0.004, "search": 0.31, "timing": 0.006},
        {"search": counts},
        Refusals("gripper_link", "shelf_3", 9_120),
    )
    assert slow.summary == (
        "search took 310 of 320 ms: 41,000 collision checks, 12.0% undecided by the bounds, 64% in collision: "
        "narrow passage between 'gripper_link' and 'shelf_3'"
    )
    wide = replace(slow, checks={"search": replace(counts, touching_by_bounds=920, free_by_bounds=35_160)})
    assert wide.summary.endswith("2% in collision: most often 'gripper_link' and 'shelf_3'")
    assert replace(slow, checks={}).summary == "search took 310 of 320 ms"
    assert PlanStatistics().summary == ""
    assert PlanningError(ErrorCode.FAILURE, "no plan").statistics is None
