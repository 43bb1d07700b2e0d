# SPDX-License-Identifier: BSD-3-Clause
"""Corners of a path are rounded as far as the world allows, also where the last check of a motion does not look."""

from __future__ import annotations

import functools

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
)
from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

RADIUS, GAP = 0.02, 0.01  # [m] of the tool, and between it and the box beside a corner
WAY = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.6], [1.0, 0.6]])
AXIS = """<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{name}_slide"/>
<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<link name="{name}_slide">{body}</link>"""
TOOL = f'<collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>'


@functools.cache
def gantry() -> RobotModel:
    """A ball on two slides, x and y."""
    x = AXIS.format(name="x", parent="frame", axis="1 0 0", body="")
    y = AXIS.format(name="y", parent="x_slide", axis="0 1 0", body=TOOL)
    srdf = '<robot name="gantry"><group name="tool"><joint name="x"/><joint name="y"/></group></robot>'
    return RobotModel(f'<robot name="gantry"><link name="frame"/>{x}{y}</robot>', srdf)


class AlongTheWay(Planner):
    """A planner whose path is WAY, the first vertices of it a way out of a collision."""

    def __init__(self, path_prefix: int) -> None:
        self._path_prefix = path_prefix

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        return PlannedPath(WAY, path_prefix=self._path_prefix, keep_shape=True)


def motion(corner: int | None, path_prefix: int = 0) -> Trajectory:
    """The timed way, with a box on the inner side of one of its corners."""
    model, scene = gantry(), empty_scene(gantry())
    if corner is not None:
        away = 0.15 + RADIUS + GAP
        inside = np.array([[-away, away], [away, -away]])[corner - 1]
        pose = pin.SE3(np.eye(3), np.array([*(WAY[corner] + inside), 0.0]))
        scene = scene.with_object(CollisionObject("box", pose, ((Box(0.3, 0.3, 0.1), pin.SE3.Identity()),)))
    pipeline = PlanningPipeline(
        KinematicsPool(model),
        PipelineSettings(default_velocity_scaling_factor=1.0, default_acceleration_scaling_factor=1.0),
        AlongTheWay(path_prefix),
        adapters=(AddTimeOptimalParameterization(),),
    )
    goal = JointGoal(dict(zip(("x", "y"), WAY[-1].tolist(), strict=True)))
    return pipeline.plan(PlanningRequest(scene, "tool", (goal,), allowed_time_s=20.0)).trajectory


@pytest.mark.parametrize("path_prefix", [0, 1, 2])
@pytest.mark.parametrize("corner", [1, 2])
def test_a_corner_beside_a_box_is_rounded_less(corner: int, path_prefix: int) -> None:
    timed, wide = motion(corner, path_prefix), motion(None)
    away = 0.15 + RADIUS + GAP
    middle = WAY[corner] + np.array([[-away, away], [away, -away]])[corner - 1]
    points = timed.positions_at(np.arange(0.0, timed.duration_s, 1.0e-3))
    outside = np.maximum(np.abs(points - middle) - 0.15, 0.0)
    assert (np.linalg.norm(outside, axis=1) > RADIUS).all()
    assert timed.duration_s > wide.duration_s
    speeds = np.linalg.norm(timed.velocities[5:-5], axis=1)
    assert speeds.min() > 0.01, "it does not stop at the corners"


def test_corners_are_rounded_up_to_the_deviation() -> None:
    wide = motion(None)
    points = wide.positions_at(np.arange(0.0, wide.duration_s, 1.0e-3))
    for corner in WAY[1:3]:
        assert 0.02 < np.linalg.norm(points - corner, axis=1).min() < PipelineSettings().blend_deviation
