# SPDX-License-Identifier: BSD-3-Clause
"""Verdicts of the compiled collision check against a second checker; 10,000 of each: benchmarks/collision_verdicts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_testing.planning.collision_worlds import (
    Comparison,
    Verdicts,
    compared_around,
    compared_in,
    world_with,
)
from modular_framework_testing.planning.independent_checker import IndependentChecker

WORLDS = 5


@pytest.fixture(scope="module")
def second(robot: object) -> IndependentChecker:
    return IndependentChecker(robot.urdf, robot.srdf, package_resolver)


@pytest.mark.parametrize(("compare", "count", "seed"), [(Comparison.states, 120, 11), (Comparison.edges, 20, 13)])
def test_nothing_that_touches_is_called_free_and_nothing_far_from_contact_is_refused(
    model: RobotModel,
    second: IndependentChecker,
    compare: Callable[[Comparison, np.random.Generator, int], Verdicts],
    count: int,
    seed: int,
) -> None:
    rng, total = np.random.default_rng(seed), Verdicts()
    for held in range(WORLDS):
        total += compare(compared_in(world_with(model, second, rng, held), second), rng, count)
    assert total.asked == WORLDS * count
    assert total.touching_called_free == 0 and total.refused_though_apart == 0, total
    assert 0.1 * total.asked < total.free < 0.9 * total.asked


@pytest.mark.parametrize("compare", [Comparison.states, Comparison.edges])
def test_joints_that_stay_move_no_pair_that_is_compared(
    model: RobotModel, second: IndependentChecker, compare: Callable[[Comparison, np.random.Generator, int], Verdicts]
) -> None:
    rng = np.random.default_rng(14)
    total = compare(compared_around(model, second, rng, model.group("arm_and_manipulator").indices[2:]), rng, 40)
    assert total.touching_called_free == 0 and total.refused_though_apart == 0, total
    assert total.free > 4


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
