# SPDX-License-Identifier: BSD-3-Clause
"""Verdicts of the compiled collision check against a second checker; 10,000 states: benchmarks/collision_verdicts."""

from __future__ import annotations

import numpy as np
import pytest
from collision_worlds import Verdicts, compare_verdicts, world_with
from independent_checker import IndependentChecker

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver

WORLDS, STATES_PER_WORLD = 5, 120


@pytest.fixture(scope="module")
def second(robot: object) -> IndependentChecker:
    return IndependentChecker(robot.urdf, robot.srdf, package_resolver)


def test_no_touching_state_is_called_free_and_no_free_one_far_from_contact_is_refused(
    model: RobotModel, second: IndependentChecker
) -> None:
    rng = np.random.default_rng(11)
    total = sum((compare_verdicts(model, second, rng, STATES_PER_WORLD, held) for held in range(WORLDS)), Verdicts())
    assert total.states == WORLDS * STATES_PER_WORLD
    assert total.touching_called_free == 0 and total.refused_though_apart == 0, total
    assert 0.1 * total.states < total.free < 0.9 * total.states


def test_states_on_a_path_called_free_touch_nothing(model: RobotModel, second: IndependentChecker) -> None:
    rng = np.random.default_rng(12)
    scene = world_with(model, second, rng, 0)
    group = model.group("arm_and_manipulator")
    rest = model.default_positions()
    motion = MotionChecker(ExactCollisionChecker(scene, group.indices), group.indices, rest)
    checked = 0
    for _ in range(150):
        start = rng.uniform(-np.pi, np.pi, len(group.joints))
        end = start + rng.normal(size=len(start)) * 0.3
        if not motion.edge_is_free(start, end, 0.02):
            continue
        count = int(np.ceil(np.abs(end - start).max() / 0.02))
        checked += count
        for number in range(1, count + 1):
            full_positions = motion.full_positions(start + number / count * (end - start))
            assert not second.collisions(dict(zip(model.joint_names, full_positions.tolist(), strict=True)))
    assert checked > 200
