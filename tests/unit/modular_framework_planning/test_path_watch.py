# SPDX-License-Identifier: BSD-3-Clause
"""While the robot moves, a change of the scene matters only where the rest of the motion goes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_execution.path_watch import PathWatch

ARM = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
START = np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0])
END = START + [1.5, 0, 0, 0, 0, 0]
ROWS = np.linspace(START, END, 31)
TIMES = np.linspace(0.0, 3.0, 31)


def scene_at(model: RobotModel, values: np.ndarray) -> PlanningScene:
    return empty_scene(model, model.merge(model.default_positions(), dict(zip(ARM, values, strict=True))))


def with_box_at_tip(scene: PlanningScene, values: np.ndarray) -> PlanningScene:
    """A box where the gripper is at these joint positions."""
    place = scene_at(scene.model, values).frame_transform("eg_manipulator").translation
    shape = Box(0.1, 0.1, 0.1)
    return scene.with_object(CollisionObject("box", pin.SE3(np.eye(3), place), ((shape, pin.SE3.Identity()),)))


@pytest.fixture
def scene(model: RobotModel) -> PlanningScene:
    return scene_at(model, START)


def test_a_box_on_the_way_blocks_and_is_named(scene: PlanningScene) -> None:
    watch = PathWatch(ARM, TIMES, ROWS, scene)
    assert watch.scene_collision(scene) is None
    hit = watch.scene_collision(with_box_at_tip(scene, END))
    assert hit is not None and "object 'box'" in hit.describe()
    assert watch.scene_collision(with_box_at_tip(scene, END - [3.0, 0, 0, 0, 0, 0])) is None


def test_what_lies_behind_the_robot_does_not_block(scene: PlanningScene) -> None:
    watch = PathWatch(ARM, TIMES, ROWS, scene)
    behind = with_box_at_tip(scene, START)
    assert watch.scene_collision(behind)
    for values in ROWS[:25]:
        watch.advance(scene_at(scene.model, values).positions)
    assert watch.scene_collision(behind.with_positions(scene_at(scene.model, ROWS[24]).positions)) is None


def test_a_contact_the_planner_accepted_does_not_block(scene: PlanningScene) -> None:
    touching = with_box_at_tip(scene, START)
    watch = PathWatch(ARM, TIMES, ROWS, touching)
    far = CollisionObject("far", pin.SE3(np.eye(3), np.array([0.0, 0.0, 3.0])), ((Box(1, 1, 1), pin.SE3.Identity()),))
    assert watch.scene_collision(touching.with_object(far)) is None
    assert watch.scene_collision(with_box_at_tip(touching, END))
