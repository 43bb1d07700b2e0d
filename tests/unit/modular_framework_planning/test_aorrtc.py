# SPDX-License-Identifier: BSD-3-Clause
"""AORRTC finds the shortest way, known here from plane geometry, and the same one with the same seed."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from test_corners import RADIUS, gantry
from test_rrt_connect import COVER, GOAL, RANGE, STEP, WALL, problem_in, scene_with, small  # noqa: F401 - a fixture

from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.rrt_connect.rrt_connect import RrtConnect, TreeGrowth
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.path_shortening import path_length

LEFT, RIGHT, BELOW = 0.4, 0.6, -0.2  # sides of the box [m]


def shortest_way() -> float:
    """From (0, 0) to (1, 0), below the box: two tangents, two arcs round its corners and the way along its side."""
    to_corner = math.hypot(LEFT, BELOW)
    slope = math.atan2(-BELOW, LEFT) + math.asin(RADIUS / to_corner)
    return 2.0 * (math.sqrt(to_corner**2 - RADIUS**2) + RADIUS * slope) + RIGHT - LEFT


def planned(planner_id: str, seed: int, repeatable: bool = True) -> PlanningResult:
    model = gantry()
    pose = pin.SE3(np.eye(3), np.array([0.5, BELOW + 0.5, 0.0]))
    box = CollisionObject("box", pose, ((Box(RIGHT - LEFT, 1.0, 0.1), pin.SE3.Identity()),))
    scene = empty_scene(model).with_object(box)
    pipeline = PipelineSpec(settings=PipelineSettings(seed=seed)).build(model, KinematicsPool(model))
    goal = JointGoal({"x": 1.0, "y": 0.0})
    request = PlanningRequest(scene, "tool", (goal,), planner_id=planner_id, allowed_time_s=60.0 if repeatable else 2.0)
    return pipeline.plan(request, repeatable)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_way_is_hardly_longer_than_the_shortest_one(seed: int) -> None:
    answer = planned("AORRTC", seed)
    assert answer.planner_id == "AORRTC"
    assert shortest_way() - 1e-3 < path_length(answer.path) < 1.03 * shortest_way()


def test_a_seed_repeats_the_way() -> None:
    one, again, other = (planned("AORRTC", seed).path for seed in (1, 1, 2))
    assert np.array_equal(one, again) and not np.array_equal(one, other)


def test_without_a_seed_it_uses_its_time() -> None:
    answer = planned("AORRTC", 1, repeatable=False)
    assert 1.0 < answer.planning_time_s < 2.0
    assert path_length(answer.path) < 1.02 * shortest_way()


@pytest.mark.parametrize("seed", range(5))
def test_a_path_is_shorter_than_its_bound(small: RobotModel, seed: int) -> None:  # noqa: F811
    scene = scene_with(small, WALL, COVER)
    first = RrtConnect(
        problem_in(scene, seed), GOAL[None], TreeGrowth(check_step=STEP, max_extension=RANGE, is_weighted=False)
    ).run()
    assert first is not None
    length_bound = 0.9 * path_length(first)
    growth = TreeGrowth(check_step=STEP, max_extension=RANGE, extension_limit=3000, is_weighted=False)
    search = RrtConnect(problem_in(scene, seed), GOAL[None], growth, length_bound=length_bound)
    second = search.run()
    assert second is None or path_length(second) <= length_bound + 1e-9


def test_no_path_is_shorter_than_the_straight_way(small: RobotModel) -> None:  # noqa: F811
    problem = problem_in(scene_with(small, WALL, COVER))
    length_bound = 1.0001 * float(np.linalg.norm(GOAL - problem.start_values))
    growth = TreeGrowth(check_step=STEP, max_extension=RANGE, extension_limit=500, is_weighted=False)
    search = RrtConnect(problem, GOAL[None], growth, length_bound=length_bound)
    assert search.run() is None and search.extensions == 500
