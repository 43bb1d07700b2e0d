# SPDX-License-Identifier: BSD-3-Clause
"""The distance field against FCL, what is checked by it, and bounds on how far bodies move against kinematics."""

from __future__ import annotations

import fcl
import numpy as np
import pinocchio as pin
import pytest
from plain_coal_checker import PlainCoalChecker
from test_collision_checkers import SMALL_SRDF, SMALL_URDF

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels import compiled_paths
from modular_framework_planning.collision_detection.kernels.compiled_collision import FIELD, World
from modular_framework_planning.collision_detection.kernels.compiled_distance_field import field_distance
from modular_framework_planning.collision_detection.reaches import max_reach
from modular_framework_planning.geometry.shapes import Box, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

POINTS, SOLIDS = 400, 20
NEAR_M = 0.3
SAME_M = 1.0e-5  # FCL's own precision for a cylinder [m]


@pytest.fixture(scope="module")
def small() -> RobotModel:
    return RobotModel(SMALL_URDF, SMALL_SRDF)


def random_world(model: RobotModel, rng: np.random.Generator) -> tuple[PlanningScene, list[fcl.CollisionObject]]:
    """Returns a scene of solids at any angle, and the same solids for FCL."""
    scene, others = empty_scene(model), []
    for number in range(SOLIDS):
        x, y, z = (float(value) for value in rng.uniform(0.04, 0.2, 3))
        shape: Shape
        shape, other = (
            (Box(x, y, z), fcl.Box(x, y, z)),
            (Cylinder(z, x), fcl.Cylinder(x, z)),
            (Sphere(x), fcl.Sphere(x)),
        )[number % 3]
        angle, away, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.2), rng.uniform(-0.9, 1.2)
        at = np.array([away * np.cos(angle), away * np.sin(angle), height])  # not in the column of the robot
        pose = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), at)
        scene = scene.with_object(CollisionObject(f"solid{number}", pose, ((shape, pin.SE3.Identity()),)))
        others.append(fcl.CollisionObject(other, fcl.Transform(pose.rotation, pose.translation)))
    return scene, others


def fcl_distance(point: np.ndarray, others: list[fcl.CollisionObject]) -> float:
    """Distance of a point from the nearest solid, 0 inside of one."""
    radius = 1.0e-3
    ball = fcl.CollisionObject(fcl.Sphere(radius), fcl.Transform(np.eye(3), point))
    found = []
    for other in others:
        if fcl.collide(ball, other, fcl.CollisionRequest(), fcl.CollisionResult()):
            return 0.0
        found.append(fcl.distance(ball, other, fcl.DistanceRequest(), fcl.DistanceResult()))
    return min(found) + radius


def world_in(scene: PlanningScene) -> World:
    world = ExactCollisionChecker(scene).compiled_world
    assert world is not None
    return world


def test_the_distance_is_that_of_the_nearest_solid_or_a_bound_beyond_all_interest(small: RobotModel) -> None:
    rng = np.random.default_rng(1)
    scene, others = random_world(small, rng)
    field = world_in(scene).field
    assert len(field.kinds) == SOLIDS
    near = far = 0
    for point in rng.uniform(-1.4, 1.4, (POINTS, 3)):  # the field ends before
        expected = fcl_distance(point, others)
        found = field_distance(field, *point, NEAR_M)
        if expected > NEAR_M + SAME_M:
            far += 1
            assert NEAR_M <= found <= expected + SAME_M
        elif expected > 2.0e-3:
            near += 1
            assert found == pytest.approx(expected, abs=SAME_M)
        else:
            assert found <= expected + SAME_M
    assert near > POINTS // 10 and far > POINTS // 10


def test_points_beyond_the_cells_get_the_exact_distance(small: RobotModel) -> None:
    scene, others = random_world(small, np.random.default_rng(2))
    field = world_in(scene).field
    for point in np.random.default_rng(3).uniform(3.0, 5.0, (20, 3)):
        assert field_distance(field, *point, 0.1) == pytest.approx(fcl_distance(point, others), abs=SAME_M)


def test_a_link_that_may_touch_one_of_the_solids_is_checked_against_the_others_alone(small: RobotModel) -> None:
    scene, _ = random_world(small, np.random.default_rng(4))
    scene = scene.with_acm(scene.acm.with_entry("upper", "solid3", True))
    world = world_in(scene)
    by_field = {int(body) for body, other in world.pairs.tolist() if other == FIELD}
    alone = [pair for pair in world.watched.tolist() if world.pairs[pair, 1] != FIELD]
    owners = {int(world.pairs[pair, 0]) for pair in alone if world.joints[world.pairs[pair, 1]] < 0}
    assert len(owners - by_field) == 1, "one body has pairs of its own"
    assert by_field


def test_states_that_are_no_numbers_or_beyond_all_reach_do_no_harm(small: RobotModel) -> None:
    scene, _ = random_world(small, np.random.default_rng(13))
    checker, field = ExactCollisionChecker(scene), world_in(scene).field
    assert not checker.is_free(np.full(len(small.joint_names), np.nan))
    for far in (1.0e6, 1.0e20, -1.0e100):
        assert field_distance(field, far, 0.1, 0.1, 0.1) == pytest.approx(abs(far), rel=1.0e-3)


def test_an_obstacle_without_a_closed_form_of_its_own_is_left_out_of_the_field(small: RobotModel) -> None:
    scene, _ = random_world(small, np.random.default_rng(14))
    corners = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]])
    peak = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    pose = pin.SE3(np.eye(3), np.array([0.6, 0.6, 0.2]))
    world = world_in(scene.with_object(CollisionObject("peak", pose, ((peak, pin.SE3.Identity()),))))
    assert len(world.field.kinds) == SOLIDS
    assert np.isfinite(world.excess[world.pairs[:, 1] == FIELD]).all()


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
    scene, _ = random_world(small, rng)
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
    scene, _ = random_world(model, np.random.default_rng(8))
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
    world = world_in(random_world(small, rng)[0])
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


def test_the_farthest_end_bounds_where_points_of_the_robot_can_be(small: RobotModel) -> None:
    world = world_in(random_world(small, np.random.default_rng(11))[0])
    rng, data, farthest = np.random.default_rng(12), small.pin_model.createData(), 0.0
    for _ in range(500):
        state = np.zeros(len(small.joint_names))
        state[:3] = rng.uniform(small.lower[:3], small.upper[:3])  # with the sliding joints at zero
        pin.forwardKinematics(small.pin_model, data, state)
        farthest = max(
            farthest,
            *(
                float(np.linalg.norm((data.oMi[item.joint_id] * item.placement).translation))
                for item in small.link_geometries
            ),
        )
    assert 0.8 * farthest < max_reach(world.tree, world) < 2.0 * farthest
    assert farthest <= max_reach(world.tree, world)
