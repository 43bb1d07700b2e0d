# SPDX-License-Identifier: BSD-3-Clause
"""STOMP deforms motions around obstacles, repeats itself with a seed, keeps path constraints and says why it failed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.constraints.constraint_kinds import JointConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.stomp.optimiser import Optimiser
from modular_framework_planning.planners.stomp.planner import StompPlanner
from modular_framework_planning.planners.stomp.settings import StompSettings, read_settings
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.plugins import make_adapters
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

GROUP = "arm_and_manipulator"
START = (0.9, -1.57, 1.2, -1.2, -1.57, 0.0)
GOAL = (-0.9, -1.57, 1.2, -1.2, -1.57, 0.0)


def scene_with(model: RobotModel, height_m: float) -> PlanningScene:
    """A post between start and goal; the arm has to go over or behind it."""
    joints = model.group(GROUP).joints
    scene = empty_scene(model, model.merge(model.default_positions(), dict(zip(joints, START, strict=True))))
    group_base = model.link_transforms(scene.positions)[model.group(GROUP).base_link].translation
    middle = model.link_transforms(model.merge(scene.positions, {joints[0]: 0.0}))[model.group(GROUP).tip_link]
    place = np.array([middle.translation[0], middle.translation[1], group_base[2] + height_m / 2.0])
    return scene.with_object(
        CollisionObject("post", pin.SE3(np.eye(3), place), ((Box(0.06, 0.06, height_m), pin.SE3.Identity()),))
    )


def planned(
    model: RobotModel,
    height_m: float,
    parameters: dict[str, object] | None = None,
    goal: tuple[float, ...] = GOAL,
    **request: object,
) -> PlanningResult:
    settings = PipelineSettings(seed=4, parameters=parameters or {})
    pipeline = PlanningPipeline(
        KinematicsPool(model), settings, StompPlanner.configure(model, settings), adapters=make_adapters()
    )
    joints = model.group(GROUP).joints
    goals = (JointGoal(dict(zip(joints, goal, strict=True))),)
    return pipeline.plan(
        PlanningRequest(
            scene_with(model, height_m), GROUP, goals, **{"planner_id": "STOMP", "allowed_time_s": 600.0, **request}
        )
    )


def test_a_motion_bends_round_a_post_and_repeats_itself(model: RobotModel) -> None:
    answers = [planned(model, 0.7) for _ in range(2)]
    assert np.array_equal(answers[0].trajectory.positions, answers[1].trajectory.positions)
    assert np.allclose(answers[0].trajectory.positions[[0, -1]], [START, GOAL])
    assert np.abs(answers[0].path - np.linspace(START, GOAL, 60)).max() > 0.05


def test_a_motion_to_where_the_robot_is_has_one_posture(model: RobotModel) -> None:
    trajectory = planned(model, 0.7, goal=START).trajectory
    assert trajectory.duration_s == 0.0 and np.array_equal(trajectory.positions, [START])


def test_path_constraints_are_kept(model: RobotModel) -> None:
    number = model.index["wrist_2_joint"]
    constraints = KinematicConstraints(model, [JointConstraint("wrist_2_joint", number, -1.57, 0.1, 0.1)])
    answer = planned(model, 0.7, path_constraints=constraints)
    column = answer.trajectory.joint_names.index("wrist_2_joint")
    assert np.abs(answer.trajectory.curve(0.01)[:, column] + 1.57).max() <= 0.1 + 1e-6


def test_failure_reports_how_many_timesteps_collide_and_with_what(model: RobotModel) -> None:
    with pytest.raises(PlanningError) as caught:
        planned(model, 0.7, {"num_iterations": 1, "num_attempts": 1, "stddev": 0.001})
    assert caught.value.code == ErrorCode.PLANNING_FAILED
    assert "of 60 timesteps are invalid" in caught.value.reason and "'post'" in caught.value.reason


def test_time_and_cancelling_end_the_search(model: RobotModel) -> None:
    with pytest.raises(PlanningError) as caught:
        planned(model, 0.7, {"stddev": 0.001}, cancelled=lambda: True)
    assert caught.value.code == ErrorCode.PREEMPTED
    with pytest.raises(PlanningError) as caught:
        planned(model, 0.7, {"stddev": 0.001, "num_iterations": 1_000_000}, allowed_time_s=1.0)
    assert caught.value.code == ErrorCode.TIMED_OUT and "timesteps" in caught.value.reason


def test_parameters_of_both_moveits_are_read_and_checked() -> None:
    assert read_settings({}) == StompSettings(
        num_timesteps=60,
        num_iterations=40,
        num_iterations_after_valid=0,
        num_rollouts=30,
        max_rollouts=30,
        exponentiated_cost_sensitivity=0.8,
        control_cost_weight=0.1,
        delta_t=0.1,
        stddev=0.3,
        num_attempts=4,
    )
    assert read_settings({"stomp_moveit": {"num_timesteps": 30}}).num_timesteps == 30
    assert read_settings({"stomp": {"arm": {"optimization": {"num_rollouts": 7}}}}, "arm").num_rollouts == 7
    with pytest.raises(
        PlanningError, match=r"'num_timesteps' is 2\.5; allowed: a whole number, at least 5.*'num_rollouts' is -1"
    ):
        read_settings({"num_timesteps": 2.5, "num_rollouts": -1})


def test_update_moves_towards_the_cheaper_copies_and_keeps_the_ends() -> None:
    optimiser = Optimiser(
        read_settings({"exponentiated_cost_sensitivity": 10.0}),
        np.full(2, -5.0),
        np.full(2, 5.0),
        np.random.default_rng(1),
    )
    line = optimiser.line(np.zeros(2), np.ones(2))
    copies = optimiser.noisy_copies(line, np.full(200, 0.3))
    assert np.array_equal(copies[:, [0, -1]], np.repeat(line[None, [0, -1]], 200, axis=0))
    assert 0.2 < copies[:, 30].std(axis=0).mean() < 0.4, "standard deviation in the middle"
    costs = optimiser.costs(copies, lambda states: np.abs(states[:, 0] - 5.0))
    moved = optimiser.update(line, copies, costs)
    assert (moved[1:-1, 0] > line[1:-1, 0]).all() and np.array_equal(moved[[0, -1]], line[[0, -1]])
