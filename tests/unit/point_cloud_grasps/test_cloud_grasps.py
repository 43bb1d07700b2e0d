# SPDX-License-Identifier: BSD-3-Clause
"""Grasps on a synthetic cloud hold the true object, and the hand touches nothing else; distances are those of Coal."""

from __future__ import annotations

import functools
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from depth_camera import Box, Cylinder, Shape, Sphere, seen, turned  # noqa: E402
from two_finger_hands import GRIPPERS, Hand  # noqa: E402

from modular_framework_core.grasp_generation import solid_meshes, surface_points  # noqa: E402
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery, NoCandidatesError  # noqa: E402
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry, measure_gripper  # noqa: E402
from modular_framework_core.grasp_generation.pair_grasps import PairGrasp  # noqa: E402
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject  # noqa: E402
from point_cloud_grasps.cloud_grasps import CloudSettings, cloud_grasps  # noqa: E402

TABLE_M, X, Y = 0.84, 0.1, 0.5
TABLE = Box((2.0, 2.0, 0.02), (0.0, 0.5, TABLE_M - 0.01))
SETTINGS = CloudSettings(max_poses=80, max_candidates=12)
OBJECTS: dict[str, Shape] = {
    "box": Box((0.05, 0.07, 0.10), (X, Y, TABLE_M + 0.05), turned(0.4)),
    "can": Cylinder(0.033, 0.115, (X, Y, TABLE_M + 0.0575)),
    "ball": Sphere(0.034, (X, Y, TABLE_M + 0.034)),
}
SEEN_M = 0.004  # points of a cloud are 3.4 mm apart
IDS = ["ezgripper", "jaws"]


@functools.cache
def geometry(which: int) -> GripperGeometry:
    urdf, joint, frame = GRIPPERS[which]
    return measure_gripper(urdf(), frame, joint)


def rough(shape: Shape, error: tuple[float, float, float] = (0.01, -0.01, 0.0)) -> SceneObject:
    """What the planning scene knows: a box around the object, with an error of the pose [m]."""
    size = (
        shape.size
        if isinstance(shape, Box)
        else (2 * shape.radius, 2 * shape.radius, getattr(shape, "height", 2 * shape.radius))
    )
    return SceneObject("thing", surface_points.box(size).transformed(shape.axes, np.array(shape.centre) + error))


def query(shape: Shape, which: int = 0, seed: int = 1, obstacles: tuple[SceneObject, ...] = ()) -> GraspQuery:
    return GraspQuery(rough(shape), obstacles, TABLE_M, geometry(which), seed)


def as_coal(shape: Shape) -> tuple[Any, Any]:
    match shape:
        case Box(size=size):
            body = coal.Box(*size)
        case Sphere(radius=radius):
            body = coal.Sphere(radius)
        case Cylinder(radius=radius, height=height):
            body = coal.Cylinder(radius, height)
    return body, coal.Transform3s(shape.axes, np.array(shape.centre))


def distance(hand: Hand, which: int, grasp: PairGrasp, back: float, opening: float, shape: Shape) -> float:
    """Least distance of the hand, drawn back so far, from a shape [m]; negative where they meet."""
    gripper = geometry(which)
    rotation = grasp.pose.axes @ gripper.axes.T
    position = grasp.pose.position - back * grasp.pose.axes[:, 2]
    body, place = as_coal(shape)
    return min(
        coal.distance(part, coal.Transform3s(pose.rotation, pose.translation), body, place,
                      coal.DistanceRequest(), coal.DistanceResult())
        for part, pose in hand.shapes(position, rotation, gripper.position_for(opening)).values()
    )  # fmt: skip


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize("which", [0, 1], ids=IDS)
def test_the_hand_advances_clear_of_everything_and_its_pads_close_on_the_object(which: int, name: str) -> None:
    shape = OBJECTS[name]
    urdf, joint, frame = GRIPPERS[which]
    hand = Hand(urdf(), joint, frame)
    wall = Box((0.02, 0.6, 0.3), (X + 0.15, 0.5, TABLE_M + 0.15))  # only the camera knows of it
    grasps = cloud_grasps(query(shape, which), seen([TABLE, shape, wall]), SETTINGS)
    for grasp in grasps[:6]:
        for back in np.linspace(0.0, SETTINGS.hand.approach_distance_m, 4):
            opening = grasp.pose.opening
            assert distance(hand, which, grasp, float(back), opening, shape) > 0.0, (name, grasp)
            assert distance(hand, which, grasp, float(back), opening, wall) > 0.0, (name, grasp)
            assert distance(hand, which, grasp, float(back), opening, TABLE) > 0.0, (name, grasp)
        closed = max(0.0, grasp.pose.width - 2 * SEEN_M)
        assert distance(hand, which, grasp, 0.0, closed, shape) < 0.0, "closed, the hand holds it"


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize("noise_m", [0.0, 0.0015])
def test_contacts_are_on_opposite_sides_of_the_true_object(name: str, noise_m: float) -> None:
    shape = OBJECTS[name]
    grasps = cloud_grasps(query(shape), seen([TABLE, shape], noise_m), SETTINGS)
    widths = np.array([grasp.pose.width for grasp in grasps])
    middles = np.array([grasp.pose.contacts.mean(axis=0) for grasp in grasps]) - shape.centre
    axes = np.array([grasp.pose.axes[:, 0] for grasp in grasps])
    slack = SEEN_M + 3 * noise_m
    if isinstance(shape, Box):
        local = np.abs(axes @ shape.axes)
        side = local.argmax(axis=1)
        square = (local.max(axis=1) > math.cos(math.atan(0.3)) - 0.02) & (side < 2)
        square &= np.abs(widths - np.array(shape.size)[side]) < slack
        assert square[:6].all() and square.mean() > 0.9, "noise may round an edge"
    else:
        assert (np.abs(axes[:, 2]) < 0.35).all()
        across = np.abs(middles[:, 0] * axes[:, 1] - middles[:, 1] * axes[:, 0])
        assert (across < shape.radius * 0.35 + slack).all(), "the closing axis passes near the middle"
        assert (np.abs(widths - 2 * shape.radius) < 2 * slack).mean() > 0.7
    assert all(0.0 <= grasp.quality <= 1.0 for grasp in grasps)


def test_nothing_is_held_farther_below_what_was_seen_than_half_a_pad() -> None:
    can = OBJECTS["can"]
    top = can.centre[2] + can.height / 2  # type: ignore[union-attr]
    for grasp in cloud_grasps(query(can), seen([TABLE, can]), SETTINGS):
        assert grasp.pose.contacts[:, 2].min() > top - 3 * geometry(0).pad_half_height - SEEN_M


def test_the_seed_alone_decides() -> None:
    points = seen([TABLE, OBJECTS["can"]])

    def found(seed: int) -> list[list[float]]:
        grasps = cloud_grasps(query(OBJECTS["can"], seed=seed), points, SETTINGS)
        return [[*grasp.pose.position, grasp.quality] for grasp in grasps]

    assert found(3) == found(3)
    assert found(3) != found(4)


def test_points_that_are_not_numbers_are_left_out() -> None:
    points = seen([TABLE, OBJECTS["box"]])
    holes = points.copy()
    holes[::7] = np.nan
    assert cloud_grasps(query(OBJECTS["box"]), holes, SETTINGS)


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.full((9, 3), np.nan), seen([TABLE])], ids=["empty", "nan", "table"]
)
def test_a_cloud_without_the_object_is_refused_with_its_place(points: np.ndarray) -> None:
    with pytest.raises(NoCandidatesError, match=r"the cloud has 0 points on 'thing'.*in view of the camera"):
        cloud_grasps(query(OBJECTS["box"]), points, SETTINGS)


def test_what_is_wider_than_the_gripper_opens_is_refused_with_both_widths() -> None:
    wide = Box((0.2, 0.22, 0.1), (X, Y, TABLE_M + 0.05))
    opening = round(geometry(0).max_opening * 1000)
    with pytest.raises(
        NoCandidatesError, match=rf"narrowest is (19[5-9]|20\d) mm wide, and the gripper opens to {opening} mm"
    ):
        cloud_grasps(query(wide), seen([TABLE, wide]), SETTINGS)


def test_an_object_between_close_walls_that_only_the_camera_knows_is_refused() -> None:
    can = OBJECTS["can"]
    walls = [Box((0.02, 0.2, 0.25), (X + side * 0.055, Y, TABLE_M + 0.125)) for side in (-1.0, 1.0)] + [
        Box((0.2, 0.02, 0.25), (X, Y + side * 0.055, TABLE_M + 0.125)) for side in (-1.0, 1.0)
    ]
    low = replace(SETTINGS, region_padding_m=0.01)
    exact = GraspQuery(rough(can, (0.0, 0.0, 0.0)), (), TABLE_M, geometry(0), 1)
    with pytest.raises(NoCandidatesError, match=r"hand poses that fit .* collide with other objects"):
        cloud_grasps(exact, seen([TABLE, can, *walls]), low)
    assert cloud_grasps(exact, seen([TABLE, can]), low)


def test_objects_of_the_scene_that_the_camera_does_not_see_are_avoided_too() -> None:
    def block(x: float, y: float, size: tuple[float, float, float]) -> SceneObject:
        place = np.array([x, y, TABLE_M + size[2] / 2])
        return SceneObject(
            "wall",
            surface_points.box(size).transformed(np.eye(3), place),
            (solid_meshes.move_mesh(solid_meshes.box(size), np.eye(3), place),),
        )

    can, points = OBJECTS["can"], seen([TABLE, OBJECTS["can"]])
    walls = tuple(block(X + side * 0.055, Y, (0.02, 0.2, 0.25)) for side in (-1.0, 1.0)) + tuple(
        block(X, Y + side * 0.055, (0.2, 0.02, 0.25)) for side in (-1.0, 1.0)
    )
    with pytest.raises(NoCandidatesError, match=r"hand poses that fit .* \d+ of them with 'wall'"):
        cloud_grasps(query(can, obstacles=walls), points, SETTINGS)


def test_the_table_is_found_where_it_is_not_where_the_scene_says() -> None:
    low = 0.015
    table = Box((2.0, 2.0, 0.02), (0.0, 0.5, TABLE_M - 0.01 - low))
    box = OBJECTS["box"]
    lower = Box(box.size, (X, Y, TABLE_M + 0.05 - low), box.axes)  # type: ignore[union-attr]
    wanted = GraspQuery(rough(box), (), TABLE_M, geometry(0), 1)
    for grasp in cloud_grasps(wanted, seen([table, lower]), SETTINGS):
        assert grasp.pose.contacts[:, 2].max() < TABLE_M + 0.10 - low + SEEN_M
