# SPDX-License-Identifier: BSD-3-Clause
"""Shortened paths keep their ends, are free and no longer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.path_shortening import path_length, shorten

CORNER = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
GROUP, STEP = "arm_and_manipulator", 0.004


class NoCuts(np.random.Generator):
    """Draws the same point twice, so that nothing is cut."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def random(self, size: Any = None, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        return np.zeros(size)


def outside_disc(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether a line keeps clear of the unit disc around the origin."""
    way = second - first
    along = np.clip(-(first @ way) / max(way @ way, 1e-30), 0.0, 1.0)
    return bool(np.linalg.norm(first + along * way) > 1.0)


@pytest.mark.parametrize(("least", "height"), [(0.2, 0.25), (0.4, 0.5), (0.9, 1.0)])
def test_a_corner_is_pulled_half_of_the_way_twice_as_far_as_edges_stay_free(least: float, height: float) -> None:
    short = shorten(CORNER, lambda first, second: max(first[1], second[1]) >= least, np.inf, NoCuts())
    assert np.allclose(short, [[0.0, 0.0], [1.0, height], [2.0, 0.0]])


def test_vertices_are_left_out_where_their_neighbours_can_be_joined() -> None:
    zigzag = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, -1.0], [3.0, 1.0], [4.0, 0.0]])
    assert np.array_equal(shorten(zigzag, lambda first, second: True, np.inf, None), zigzag[[0, -1]])
    adjacent = shorten(zigzag, lambda first, second: second[0] - first[0] < 2.5, np.inf, None)
    assert np.array_equal(adjacent, zigzag[[0, 2, 4]])
    assert np.array_equal(shorten(zigzag, lambda first, second: False, np.inf, None), zigzag)


def test_when_the_time_is_over_the_path_stays() -> None:
    assert np.array_equal(shorten(CORNER, lambda first, second: True, 0.0, np.random.default_rng(0)), CORNER)


def test_a_way_round_a_disc_is_nearly_the_shortest_one() -> None:
    angles = np.linspace(0.0, np.pi, 40)
    rng, ratios = np.random.default_rng(3), []
    for seed in range(20):
        radius = 1.5 + rng.uniform(0.0, 0.8, len(angles))
        radius[[0, -1]] = 2.0
        path = radius[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        short = shorten(path, outside_disc, np.inf, np.random.default_rng(seed))
        assert np.array_equal(short[[0, -1]], path[[0, -1]])
        assert all(outside_disc(first, second) for first, second in zip(short[:-1], short[1:], strict=True))
        ratios.append(path_length(short) / (2.0 * np.sqrt(3.0) + np.pi / 3.0))
    assert min(ratios) > 1.0
    assert np.median(ratios) < 1.1
    assert max(ratios) < 1.3


def test_a_shortened_path_among_boxes_is_free_and_often_much_shorter(model: RobotModel) -> None:
    group, rng = model.group(GROUP), np.random.default_rng(5)
    scene = empty_scene(model)
    for number in range(8):
        angle = 2.0 * np.pi * number / 8.0
        pose = pin.SE3(np.eye(3), np.array([0.6 * np.cos(angle), 0.6 * np.sin(angle), rng.uniform(1.0, 1.5)]))
        scene = scene.with_object(CollisionObject(f"box{number}", pose, ((Box(0.12, 0.12, 0.12), pin.SE3.Identity()),)))
    checker = ExactCollisionChecker(scene, group.indices)
    motion = MotionChecker(checker, group.indices, scene.positions)
    shorter = 0
    for seed in range(10):
        path = [scene.positions[group.indices]]
        while len(path) < 8:  # a random walk along free edges
            step = path[-1] + rng.normal(0.0, 0.4, len(group.joints))
            if motion.edge_is_free(path[-1], step, STEP):
                path.append(step)
        vertices = np.array(path)

        def is_free(first: np.ndarray, second: np.ndarray) -> bool:
            return motion.edge_is_free(first, second, STEP)

        short = shorten(vertices, is_free, np.inf, np.random.default_rng(seed))
        assert all(is_free(first, second) for first, second in zip(short[:-1], short[1:], strict=True))
        shorter += path_length(short) < 0.9 * path_length(vertices)
    assert shorter > 5
