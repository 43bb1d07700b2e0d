# SPDX-License-Identifier: BSD-3-Clause
"""What the scene keeps beyond objects counts in collision checks: padding, scale, held margins and the octomap."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.geometry.shapes import Box, Mesh, Shape, Sphere
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import empty_map
from modular_framework_planning.perception.self_filter import bodies_in_scene
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix
from modular_framework_planning.planning_scene.padding import Padding, uniform_padding
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

HAND, FOREARM, GAP = "ezgripper_palm_link", "forearm_link", 0.01
NOTHING = np.empty((0, 3))


@pytest.fixture(scope="module")
def scene(model: RobotModel) -> PlanningScene:
    return empty_scene(model, model.merge(model.default_positions(), {"shoulder_lift_joint": -1.57}))


def top_of(scene: PlanningScene) -> float:
    """Height of the robot's highest point [m]."""
    return max(
        _top(item.geometry, pose)
        for (_, pose), item in zip(bodies_in_scene(scene, scene.positions), scene.model.link_geometries, strict=True)
    )


def _top(geometry: object, pose: pin.SE3) -> float:
    up, height = pose.rotation[2], pose.translation[2]
    match geometry:
        case coal.Box():
            return float(height + np.abs(up) @ geometry.halfSide)
        case coal.Cylinder():
            return float(height + abs(up[2]) * geometry.halfLength + geometry.radius * np.hypot(up[0], up[1]))
        case _:
            return float(height + (np.array(geometry.vertices()) @ up).max())


def ceiling(scene: PlanningScene, gap: float = GAP) -> CollisionObject:
    """A ceiling with a gap [m] above the robot."""
    return CollisionObject(
        "ceiling",
        pin.SE3(np.eye(3), np.array([0.0, 0.0, top_of(scene) + gap + 0.5])),
        ((Box(5.0, 5.0, 1.0), pin.SE3.Identity()),),
    )


def is_free(scene: PlanningScene) -> bool:
    checker = ExactCollisionChecker(scene)
    free = bool(checker.is_free(scene.positions))
    assert free == (not checker.contacts(scene.positions, include_fixed=False)), "both questions have one answer"
    return free


def test_padding_is_kept_from_the_world_to_the_millimetre_and_not_between_links(scene: PlanningScene) -> None:
    below = scene.with_object(ceiling(scene))
    assert is_free(below)
    for padding, free in ((GAP - 0.001, True), (GAP + 0.001, False)):
        padded = below.with_padding(uniform_padding(scene.model.frame_ids, padding, 1.0))
        assert is_free(padded) is free, padding
        assert is_free(below.with_padding(Padding(objects=padding))) is free
    assert is_free(scene.with_padding(uniform_padding(scene.model.frame_ids, 0.05, 1.0))), "links come closer than that"


def test_a_scaled_link_keeps_at_least_what_the_scaled_mesh_would(scene: PlanningScene) -> None:
    below = scene.with_object(ceiling(scene))
    assert not is_free(below.with_padding(uniform_padding(scene.model.frame_ids, 0.0, 1.5)))
    assert is_free(below.with_padding(uniform_padding(scene.model.frame_ids, 0.0, 0.5)))


def test_a_held_object_keeps_its_own_margin(scene: PlanningScene) -> None:
    hand = scene.model.link_transforms(scene.positions)[HAND]
    ball_at = np.array([hand.translation[0], hand.translation[1], top_of(scene) + 0.2])
    ball = CollisionObject("ball", hand.actInv(pin.SE3(np.eye(3), ball_at)), ((Sphere(0.05), pin.SE3.Identity()),))
    holding = scene.with_attached(AttachedObject(ball, HAND, frozenset({HAND})))
    roof = CollisionObject(
        "roof", pin.SE3(np.eye(3), ball_at + [0.0, 0.0, 0.05 + GAP + 0.5]), ((Box(5.0, 5.0, 1.0), pin.SE3.Identity()),)
    )
    holding = holding.with_object(roof)
    for margin, free in ((GAP - 0.001, True), (GAP + 0.001, False)):
        assert is_free(holding.with_padding(Padding(attached=margin))) is free


def test_voxels_are_obstacles_that_an_entry_for_the_octomap_allows(scene: PlanningScene) -> None:
    wrist = scene.model.link_transforms(scene.positions)["wrist_2_link"].translation
    points = wrist[None] + np.array([[0.0, 0.0, 0.0]])
    seen = empty_map(0.05).with_point_cloud(np.zeros(3) + 3.0, points, NOTHING, NOTHING)
    blocked = scene.with_octomap(Octree(seen))
    assert not is_free(blocked)
    names = {
        name
        for item in ExactCollisionChecker(blocked).contacts(blocked.positions)
        for name in (item.first.name, item.second.name)
    }
    assert "<octomap>" in names
    acm = blocked.acm
    assert is_free(blocked.with_acm(AllowedCollisionMatrix(acm.entries, {"<octomap>": True}, acm.names)))
    assert is_free(blocked.with_octomap(None)) and is_free(scene.with_octomap(Octree(empty_map(0.05))))
    away = pin.SE3(np.eye(3), np.array([0.0, 0.0, 2.0]))
    assert is_free(scene.with_octomap(Octree(seen), away)), "the map stands where its origin is"


BOX_LINK_URDF = """<robot name="box"><link name="base"/><link name="arm"><collision><geometry><box size="0.4 0.4 0.4"/>
</geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""
BOX_LINK_SRDF = '<robot name="box"><group name="arm"><joint name="turn"/></group></robot>'
CUBE = trimesh.creation.box((0.05, 0.05, 0.05))


@pytest.mark.parametrize(
    "thing",
    [
        Box(0.05, 0.05, 0.05),
        Sphere(0.03),
        Mesh(np.asarray(CUBE.vertices), np.asarray(CUBE.faces, dtype=np.int64)),
        Octree(empty_map(0.05).with_point_cloud(np.full(3, 3.0), np.zeros((1, 3)), NOTHING, NOTHING)),
    ],
    ids=lambda item: type(item).__name__,
)
def test_a_thing_wholly_inside_a_link_that_is_a_box_collides(thing: Shape) -> None:
    scene = empty_scene(RobotModel(BOX_LINK_URDF, BOX_LINK_SRDF, {}, lambda name: name))
    for place, free in ((0.0, False), (0.5, True)):
        pose = pin.SE3(np.eye(3), np.array([place, 0.0, 0.0]))
        placed = scene.with_object(CollisionObject("thing", pose, ((thing, pin.SE3.Identity()),)))
        assert is_free(placed) is free
        assert bool(ExactCollisionChecker(placed).contacts(scene.positions)) == (not free)
