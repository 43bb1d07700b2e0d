# SPDX-License-Identifier: BSD-3-Clause
"""Spheres around and inside of bodies change how long a check takes and nothing else; they are certain."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from collision_worlds import shape_of, world_with
from independent_checker import IndependentChecker, sampled
from test_path_verdicts import BARS_SRDF, BARS_URDF, LONG, THICK
from wide_robots import SRDF, URDF
from wide_robots import robot as wide_robot

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels.compiled_collision import DECIDED_BY_SPHERES
from modular_framework_planning.collision_detection.kernels.compiled_spheres import NO_NODE, fill_heaps
from modular_framework_planning.collision_detection.kernels.compiled_triangles import Surfaces, build_sphere_tree
from modular_framework_planning.collision_detection.sphere_covers import Layers, balls_inside
from modular_framework_planning.collision_detection.sphere_layers import (
    ALL_LAYERS,
    CHOICES,
    NO_LAYERS,
    choose_layers,
    layers_for,
)
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver

MOTIONS, DENSE = 150, 2.0e-3  # DENSE [rad or m]
DEEP = Layers(127, 8)


@pytest.fixture(scope="module")
def sliding(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    """Bars on three joints that turn and one that slides."""
    path = tmp_path_factory.mktemp("bars") / "bar.stl"
    trimesh.creation.box((LONG, THICK, THICK)).export(path)
    return RobotModel(BARS_URDF, BARS_SRDF, {}, lambda _: str(path))


def among_things(model: RobotModel, rng: np.random.Generator, most: float) -> PlanningScene:
    """Boxes, cylinders, balls, cones and rings at random places, of `most` [m] in size."""
    scene = empty_scene(model)
    for number in range(10):
        shape, _ = shape_of(number % 5, rng.uniform(0.1, most, 3))
        turn = pin.exp3(rng.normal(size=3))
        pose = pin.SE3(turn, rng.uniform(-1.0, 1.0, 3))
        scene = scene.with_object(CollisionObject(f"thing{number}", pose, ((shape, pin.SE3.Identity()),)))
    return scene


def motions(model: RobotModel, rng: np.random.Generator, count: int, most: float = 1.0) -> np.ndarray:
    """Random straight motions; shape (n, 2, joints)."""
    low, high = np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)
    starts = rng.uniform(low, high, (count, len(low)))
    moves = (
        rng.uniform(-most, most, starts.shape) * rng.uniform(0.0, 1.0, (count, 1)) * (rng.random(starts.shape) < 0.7)
    )
    ends = np.clip(starts + moves, low, high)
    return np.array(
        [[model.with_mimics(start), model.with_mimics(end)] for start, end in zip(starts, ends, strict=True)]
    )


def compare(scene: PlanningScene, edges: np.ndarray, step: float) -> tuple[int, int]:
    """Compares verdicts with all layers; returns how many motions spheres alone called free and touching."""
    plain, free, touching = ExactCollisionChecker(scene, layers=NO_LAYERS), 0, 0
    expected = [plain.path_is_free(edge, step, 1) for edge in edges]
    assert 0.05 * len(edges) < sum(expected) < len(edges), "both are compared"
    assert plain.check_counts[DECIDED_BY_SPHERES] == 0
    for layers in (*CHOICES[1:], DEEP):
        checker = ExactCollisionChecker(scene, layers=layers)
        for edge, is_free in zip(edges, expected, strict=True):
            before = checker.check_counts[DECIDED_BY_SPHERES]
            assert checker.path_is_free(edge, step, 1) == is_free, layers
            decided = int(checker.check_counts[DECIDED_BY_SPHERES] - before)
            free, touching = free + decided * is_free, touching + decided * (not is_free)
    return free, touching


@pytest.mark.parametrize("step", [0.2, 0.004])
def test_the_verdicts_on_a_robot_that_holds_something_do_not_depend_on_spheres(robot: object, step: float) -> None:
    rng = np.random.default_rng(4)
    second = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
    scene = world_with(robot.model, second, rng, 4)
    free, touching = compare(scene, motions(robot.model, rng, MOTIONS), step)
    assert free > 0 and touching > 0


@pytest.mark.parametrize("step", [0.2, 0.004])
def test_the_verdicts_on_two_arms_on_a_lift_do_not_depend_on_spheres(step: float) -> None:
    rng = np.random.default_rng(5)
    free, touching = compare(among_things(wide_robot(), rng, 0.6), motions(wide_robot(), rng, MOTIONS), step)
    assert free > 0 and touching > 0


@pytest.mark.parametrize("step", [0.2, 0.004])
def test_the_verdicts_on_joints_that_slide_do_not_depend_on_spheres(sliding: RobotModel, step: float) -> None:
    rng = np.random.default_rng(6)
    free, _ = compare(among_things(sliding, rng, 0.3), motions(sliding, rng, MOTIONS), step)
    assert free > 0


def test_what_spheres_call_free_is_free_between_the_samples_as_well(model: RobotModel, robot: object) -> None:
    """The samples are so far apart that all depends on the bound between them."""
    rng, found = np.random.default_rng(7), 0
    second = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
    checker = ExactCollisionChecker(world_with(model, second, rng, 0), layers=DEEP)
    for edge in motions(model, rng, 1500, 2.0):
        before = checker.check_counts[DECIDED_BY_SPHERES]
        if checker.path_is_free(edge, 10.0, 0) and checker.check_counts[DECIDED_BY_SPHERES] > before:
            found += 1
            rest = dict(zip(model.joint_names, edge[0].tolist(), strict=True))
            assert not second.touching_pairs(model.joint_names, sampled(edge, DENSE), rest)
    assert found > 50


def tree_over(shape: trimesh.Trimesh) -> Surfaces:
    corners = np.asarray(shape.triangles, dtype=float).reshape(-1, 9)
    return Surfaces(*build_sphere_tree(corners), corners)


def test_balls_lie_inside_of_a_box_and_of_a_ring() -> None:
    halves = np.array([0.2, 0.1, 0.05])
    balls = balls_inside(tree_over(trimesh.creation.box(2.0 * halves).subdivide().subdivide()), 0, 8)
    balls = balls[balls[:, 3] > 0.0]
    assert len(balls) > 2 and balls[0, 3] > 0.04
    assert (balls[:, 3] <= (halves - np.abs(balls[:, :3])).min(axis=1) + 1e-9).all()
    inner, outer, height = 0.1, 0.2, 0.1
    ring = trimesh.creation.annulus(inner, outer, height, sections=64).subdivide().subdivide()
    balls = balls_inside(tree_over(ring), 0, 8)
    balls = balls[balls[:, 3] > 0.0]
    away = np.linalg.norm(balls[:, :2], axis=1)
    room = np.minimum(np.minimum(away - inner * np.cos(np.pi / 64), outer - away), height / 2 - np.abs(balls[:, 2]))
    assert len(balls) > 0 and (balls[:, 3] <= room + 1e-9).all(), "none is in the hole"


def test_spheres_of_every_level_hold_the_body() -> None:
    shape = trimesh.creation.icosphere(3).apply_scale((0.3, 0.1, 0.05))
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.2, 1.0])), np.array([0.1, 0.2, 0.3]))
    points = shape.vertices @ pose.rotation.T + pose.translation
    body, place, inflation = np.zeros(1, dtype=np.int64), pose.homogeneous[None, :3].copy(), 0.01
    for nodes in (1, 3, 15, 63):
        spheres = np.full((1, nodes, 4), NO_NODE)
        fill_heaps(tree_over(shape), body, place, np.zeros((1, 4)), np.array([inflation]), body, spheres)
        lowest = spheres[0, nodes // 2 :]
        gaps = np.linalg.norm(points[:, None] - lowest[None, :, :3], axis=2) - lowest[:, 3]
        assert (gaps.min(axis=1) < 1e-9 - inflation).all()


def test_one_sphere_covers_a_body_without_a_surface() -> None:
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.2, 1.0])), np.array([0.1, 0.2, 0.3]))
    spheres, nothing, sphere = np.full((2, 3, 4), NO_NODE), tree_over(trimesh.creation.box((1, 1, 1))), np.zeros((2, 4))
    sphere[1] = 0.4, 0.0, 0.0, 0.2
    poses = np.array([pose.homogeneous[:3]] * 2)
    fill_heaps(nothing, np.full(2, -1), poses, sphere, np.full(2, 0.01), np.array([1]), spheres)
    assert np.allclose(spheres[1, 0], [*(pose * np.array([0.4, 0.0, 0.0])), 0.2])
    assert (spheres[0, :, 3] == NO_NODE).all() and (spheres[1, 1:, 3] == NO_NODE).all()


def test_the_layers_are_chosen_by_measurement(caplog: pytest.LogCaptureFixture) -> None:
    two_arms = RobotModel(URDF, SRDF)
    assert layers_for(two_arms) == ALL_LAYERS
    with caplog.at_level(logging.INFO, "rosout.collision_detection"):
        chosen = choose_layers(two_arms)
    assert chosen in CHOICES and layers_for(two_arms) == chosen
    assert f"{chosen.nodes} spheres around and {chosen.balls} balls inside" in caplog.text
    assert ExactCollisionChecker(empty_scene(two_arms)).is_free(two_arms.default_positions())


def test_a_robot_without_joints_needs_no_spheres() -> None:
    block = '<link name="block"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    model = RobotModel(f'<robot name="block">{block}</robot>', '<robot name="block"/>')
    assert choose_layers(model) == NO_LAYERS


def test_the_layers_are_measured_on_joints_whose_limits_lie_far_from_zero() -> None:
    joints = "".join(
        f'<link name="l{n}"><collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>'
        f'<joint name="j{n}" type="{kind}"><parent link="{parent}"/><child link="l{n}"/><axis xyz="0 1 0"/>'
        f'<limit lower="{low}" upper="{high}" velocity="1" effort="1"/></joint>'
        for n, (kind, parent, low, high) in enumerate(
            [("revolute", "base", 4.0, 5.5), ("prismatic", "l0", 4.0, 10.0), ("prismatic", "l1", -10.0, -5.0)]
        )
    )
    model = RobotModel(f'<robot name="far"><link name="base"/>{joints}</robot>', '<robot name="far"/>')
    assert choose_layers(model) in CHOICES
