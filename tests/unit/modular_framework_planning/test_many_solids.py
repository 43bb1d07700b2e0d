# SPDX-License-Identifier: BSD-3-Clause
"""Checks among many solids against plain Coal, and bounds on how far bodies move against kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from plain_coal_checker import PlainCoalChecker
from test_collision_checkers import SMALL_SRDF, SMALL_URDF

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels import compiled_paths
from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.geometry.shapes import Box, Cylinder, Shape, Sphere
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

SOLIDS = 20


@pytest.fixture(scope="module")
def small() -> RobotModel:
    return RobotModel(SMALL_URDF, SMALL_SRDF)


def random_world(model: RobotModel, rng: np.random.Generator) -> PlanningScene:
    """Returns a scene of solids at any angle."""
    scene = empty_scene(model)
    for number in range(SOLIDS):
        x, y, z = (float(value) for value in rng.uniform(0.04, 0.2, 3))
        shape: Shape = (Box(x, y, z), Cylinder(z, x), Sphere(x))[number % 3]
        angle, away, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.2), rng.uniform(-0.9, 1.2)
        at = np.array([away * np.cos(angle), away * np.sin(angle), height])  # not in the column of the robot
        pose = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), at)
        scene = scene.with_object(CollisionObject(f"solid{number}", pose, ((shape, pin.SE3.Identity()),)))
    return scene


def world_in(scene: PlanningScene) -> World:
    world = ExactCollisionChecker(scene).compiled_world
    assert world is not None
    return world


def test_a_state_that_is_no_number_is_not_free(small: RobotModel) -> None:
    checker = ExactCollisionChecker(random_world(small, np.random.default_rng(13)))
    assert not checker.is_free(np.full(len(small.joint_names), np.nan))


def test_a_box_beside_a_thick_cylinder_does_not_touch_it(small: RobotModel) -> None:
    thick = SMALL_URDF.replace("<geometry>", '<geometry><cylinder radius="0.3" length="0.2"/></geometry><!--').replace(
        "</geometry></collision>", "--></collision>"
    )
    model = RobotModel(thick, SMALL_SRDF)
    height = float(model.link_geometries[0].placement.translation[2])
    free = []
    for angle in np.array([0, 7, 18, 31, 39, 45, 52, 60]) * 2.0 * np.pi / 64:  # corners of the prism around it
        turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))
        pose = turned * pin.SE3(np.eye(3), np.array([0.3 + 0.00025 + 1.0, 0.0, height]))
        other = turned * pin.SE3(np.eye(3), np.array([-3.0, 0.0, height]))
        scene = empty_scene(model)
        for name, at in (("near", pose), ("far", other)):
            scene = scene.with_object(CollisionObject(name, at, ((Box(2.0, 0.1, 0.05), pin.SE3.Identity()),)))
        state = np.zeros(len(model.joint_names))
        free.append((ExactCollisionChecker(scene).is_free(state), PlainCoalChecker(scene).is_free(state)))
    assert all(ours == plain for ours, plain in free)


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_verdicts_among_many_solids_are_those_of_plain_coal(small: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = random_world(small, rng)
    ours, plain = ExactCollisionChecker(scene), PlainCoalChecker(scene)
    verdicts = []
    for _ in range(150):
        state = small.with_mimics(rng.uniform(small.lower, small.upper))
        verdicts.append(ours.is_free(state))
        assert verdicts[-1] == plain.is_free(state)
    assert 15 < sum(verdicts) < 135


def test_solids_are_not_cut_into_triangles_for_links_that_are_cylinders(small: RobotModel) -> None:
    links = SMALL_URDF.replace("<geometry>", '<geometry><cylinder radius="0.04" length="0.2"/></geometry><!--').replace(
        "</geometry></collision>", "--></collision>"
    )
    model = RobotModel(links, SMALL_SRDF)
    scene = random_world(model, np.random.default_rng(8))
    checker = ExactCollisionChecker(scene)
    world = checker.compiled_world
    assert world is not None
    assert (world.roots[world.joints < 0] >= 0).sum() <= 1, "the base alone has triangles"
    plain, rng = PlainCoalChecker(scene), np.random.default_rng(9)
    for _ in range(100):
        state = model.with_mimics(rng.uniform(model.lower, model.upper))
        assert checker.is_free(state) == plain.is_free(state)


def test_a_body_moves_no_farther_than_the_bound_and_the_bound_of_a_straight_motion_is_close(small: RobotModel) -> None:
    rng, data = np.random.default_rng(10), small.pin_model.createData()
    world = world_in(random_world(small, rng))
    shares = []
    for _ in range(60):
        middle = rng.uniform(-2.0, 2.0, len(small.joint_names))
        change = rng.uniform(-1.0, 1.0, len(middle)) * rng.choice([0.01, 0.1, 0.5])
        samples = compiled_paths.sample(np.array([middle - change, middle + change]), 1.0e-3)
        section = compiled_paths.new_workspace(world).section
        compiled_paths.evaluate_middle(world, samples, 0, int(samples.vertex_samples[-1]), True, section)
        for body in np.flatnonzero(world.joints >= 0):
            joint = int(world.joints[body]) + 1
            x, y, z, radius = world.spheres[body]
            corners = rng.normal(size=(40, 3))
            local = np.array([x, y, z]) + radius * corners / np.linalg.norm(corners, axis=1)[:, None]
            local = local @ world.poses[body, :, :3].T + world.poses[body, :, 3]
            places = []
            for share in np.linspace(-1.0, 1.0, 9):
                pin.forwardKinematics(small.pin_model, data, middle + share * change)
                places.append(local @ data.oMi[joint].rotation.T + data.oMi[joint].translation)
            moved = np.linalg.norm(np.array(places) - places[4], axis=2).max()
            assert moved <= section.body_motions[body] + 1e-12
            shares.append(moved / section.body_motions[body])
    assert np.median(shares) > 0.5
