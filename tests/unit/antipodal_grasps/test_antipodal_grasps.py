# SPDX-License-Identifier: BSD-3-Clause
"""Antipodal grasps hold the object, and the hand touches nothing else; distances are those of FCL, a third library."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import fcl
import numpy as np
import pytest
import trimesh

from antipodal_grasps.antipodal import AntipodalSettings, antipodal_grasps
from modular_framework_core.grasp_generation import solid_meshes, surface_points
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery, NoCandidatesError
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry, measure_gripper
from modular_framework_core.grasp_generation.hand_poses import HandSettings
from modular_framework_core.grasp_generation.pair_grasps import PairGrasp, candidates_of
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_urdf.mesh_reader import TriangleMesh

sys.path.insert(0, str(Path(__file__).parents[1]))
from two_finger_hands import GRIPPERS, Hand, ezgripper, fixed_jaw, jaws, unequal_jaws  # noqa: E402

SETTINGS = AntipodalSettings(max_poses=60, max_candidates=12)
TABLE_M, PLACE = 0.84, (0.1, 0.5)
SAMPLING_M = 0.004  # points of a surface are up to 4 mm apart
TOUCH_M = 0.002  # how far a pad may be in the object when its points say that it touches


def placed(name: str, surface: Any, solids: list[TriangleMesh], yaw: float = 0.4) -> SceneObject:
    """The object on the table, turned."""
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    place = np.array([*PLACE, TABLE_M - surface.points[:, 2].min()])
    return SceneObject(
        name, surface.transformed(turn, place), tuple(solid_meshes.move_mesh(solid, turn, place) for solid in solids)
    )


def box(name: str, size: tuple[float, float, float], centre: tuple[float, float, float]) -> SceneObject:
    place = np.array(centre)
    return SceneObject(
        name,
        surface_points.box(size).transformed(np.eye(3), place),
        (solid_meshes.move_mesh(solid_meshes.box(size), np.eye(3), place),),
    )


def mesh_object() -> SceneObject:
    drawn = trimesh.creation.capsule(0.06, 0.025, count=(16, 16))
    vertices, triangles = np.asarray(drawn.vertices), np.asarray(drawn.faces, dtype=np.int64)
    return placed("capsule", surface_points.mesh(vertices, triangles), [TriangleMesh(vertices, triangles)])


OBJECTS = {
    "box": placed("box", surface_points.box((0.05, 0.06, 0.12)), [solid_meshes.box((0.05, 0.06, 0.12))]),
    "can": placed("can", surface_points.cylinder(0.115, 0.033), [solid_meshes.cylinder(0.115, 0.033)]),
    "ball": placed("ball", surface_points.sphere(0.034), [solid_meshes.sphere(0.034)]),
    "capsule": mesh_object(),
}
TABLE = box("table", (1.0, 1.0, 0.8), (0.0, 0.5, TABLE_M - 0.4))
WALL = box("wall", (0.02, 0.6, 0.4), (PLACE[0] + 0.16, 0.5, TABLE_M + 0.2))
_GEOMETRIES: dict[str, GripperGeometry] = {}


def geometry(urdf: Callable[[], str], joint: str, frame: str) -> GripperGeometry:
    if joint not in _GEOMETRIES:
        _GEOMETRIES[joint] = measure_gripper(urdf(), frame, joint)
    return _GEOMETRIES[joint]


def query(target: SceneObject, gripper: GripperGeometry, *obstacles: SceneObject, seed: int = 1) -> GraspQuery:
    return GraspQuery(target, obstacles, TABLE_M, gripper, seed)


def tree(scene_object: SceneObject) -> fcl.CollisionObject:
    whole = solid_meshes.join_meshes(scene_object.solids)
    model = fcl.BVHModel()
    model.beginModel(len(whole.vertices), len(whole.triangles))
    model.addSubModel(whole.vertices, whole.triangles)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def as_fcl(shape: Any, pose: Any) -> fcl.CollisionObject:
    if isinstance(shape, coal.Box):
        made = fcl.Box(*(2.0 * shape.halfSide))
    else:
        assert isinstance(shape, coal.Cylinder)
        made = fcl.Cylinder(shape.radius, 2.0 * shape.halfLength)
    return fcl.CollisionObject(made, fcl.Transform(pose.rotation, pose.translation))


def distances(
    hand: Hand, gripper: GripperGeometry, grasp: PairGrasp, back: float, joint: float, body: fcl.CollisionObject
) -> dict[str, float]:
    """Distance of each shape of the hand from a body [m], negative where they meet, the hand drawn back so far."""
    rotation = grasp.pose.axes @ gripper.axes.T
    position = grasp.pose.position - back * grasp.pose.axes[:, 2]
    found = {}
    for name, (shape, pose) in hand.shapes(position, rotation, joint).items():
        part = as_fcl(shape, pose)
        result = fcl.DistanceResult()
        found[name] = fcl.distance(part, body, fcl.DistanceRequest(), result)
        if fcl.collide(part, body, fcl.CollisionRequest(), fcl.CollisionResult()):
            found[name] = min(found[name], -1e-6)
    return found


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize(("urdf", "joint", "frame"), GRIPPERS, ids=["ezgripper", "jaws"])
def test_the_hand_advances_and_closes_without_touching_anything_but_with_its_pads(
    urdf: Callable[[], str], joint: str, frame: str, name: str
) -> None:
    gripper, hand = geometry(urdf, joint, frame), Hand(urdf(), joint, frame)
    target, obstacles = OBJECTS[name], [TABLE, WALL]
    grasps = antipodal_grasps(query(target, gripper, *obstacles), SETTINGS)
    assert grasps, f"no grasp of {name}"
    target_body, bodies = tree(target), [tree(each) for each in obstacles]
    for grasp in grasps[:6]:
        pregrasp = gripper.position_for(grasp.pose.opening)
        seen = []
        for back in np.linspace(0.0, SETTINGS.hand.approach_distance_m, 4):
            room = distances(hand, gripper, grasp, float(back), pregrasp, target_body)
            assert min(room.values()) > SETTINGS.hand.min_finger_clearance_m - SAMPLING_M, (name, grasp, back, room)
            seen += [min(distances(hand, gripper, grasp, float(back), pregrasp, body).values()) for body in bodies]
        touch = gripper.position_for(grasp.pose.width + TOUCH_M)
        for closing in np.linspace(pregrasp, touch, 4):
            room = distances(hand, gripper, grasp, 0.0, float(closing), target_body)
            assert min(room.values()) > 0.0, (name, grasp, closing, room)
            seen += [min(distances(hand, gripper, grasp, 0.0, float(closing), body).values()) for body in bodies]
        assert min(seen) > 0.0, (name, grasp)
        assert grasp.clearance <= min(seen) + 1e-4, "what is reported is no more than what FCL measures"


@pytest.mark.parametrize(
    ("urdf", "joint"), [(fixed_jaw, "slide"), (unequal_jaws, "drive")], ids=["fixed jaw", "unequal strokes"]
)
def test_jaws_of_unequal_strokes_advance_around_the_object_and_push_it_to_the_slower_jaw(
    urdf: Callable[[], str], joint: str
) -> None:
    gripper, hand = measure_gripper(urdf(), "tool", joint), Hand(urdf(), joint, "tool")
    target = placed("bar", surface_points.box((0.02, 0.06, 0.12)), [solid_meshes.box((0.02, 0.06, 0.12))])
    grasps = antipodal_grasps(query(target, gripper, TABLE), SETTINGS)
    assert grasps
    sides = {float(np.sign(grasp.pose.axes[:, 0] @ grasps[0].pose.axes[:, 0])) for grasp in grasps}
    assert sides == {-1.0, 1.0}, "the slower jaw may be on either side"
    for grasp in grasps[:6]:
        pregrasp, resting = gripper.position_for(grasp.pose.opening), tree(target)
        for back in np.linspace(0.0, SETTINGS.hand.approach_distance_m, 4):
            room = distances(hand, gripper, grasp, float(back), pregrasp, resting)
            assert min(room.values()) > SETTINGS.hand.min_finger_clearance_m - SAMPLING_M, (grasp, back, room)
        assert room["left_0"] == pytest.approx(room["right_0"], abs=1e-3) and room["left_0"] > 0.0
        closed = grasp.pose.width + TOUCH_M
        push = gripper.pad_centre_at(closed) - gripper.pad_centre_at(grasp.pose.opening)
        held = tree(target)
        held.setTranslation(grasp.pose.axes[:, 0] * push[0])
        room = distances(hand, gripper, grasp, 0.0, gripper.position_for(closed), held)
        assert all(0.0 < room[pad] < TOUCH_M for pad in ("left_0", "right_0")), room
        assert min(room.values()) > 0.0, room


def test_a_turned_hand_closes_at_the_same_place_if_its_frame_is_beside_the_pads() -> None:
    beside = jaws().replace('<origin xyz="0 0 0.115"/>', '<origin xyz="0.01 0.006 0.115"/>')
    gripper, settings = measure_gripper(beside, "tool", "slide"), SETTINGS
    grasps = antipodal_grasps(query(OBJECTS["box"], gripper, TABLE), settings)
    candidates = candidates_of(grasps, gripper, settings)
    assert len(candidates) == 2 * len(grasps) > 0
    for grasp, candidate in zip(2 * grasps, candidates, strict=True):
        pads = candidate.position + candidate.hand_axes @ gripper.pad_centre_at(grasp.pose.width)
        beside_contacts = candidate.hand_axes.T @ (pads - grasp.pose.contacts.mean(axis=0))
        assert beside_contacts[0] == pytest.approx(0.0, abs=TOUCH_M), "along the closing direction"
    for one, turned in zip(candidates[: len(grasps)], candidates[len(grasps) :], strict=True):
        first, second = (each.position + each.hand_axes @ gripper.pad_centre_at(0.05) for each in (one, turned))
        assert first == pytest.approx(second, abs=1e-6)


@pytest.mark.parametrize("name", OBJECTS)
def test_the_pads_close_on_both_contacts_within_the_friction_cone(name: str) -> None:
    gripper, target = geometry(*GRIPPERS[0]), OBJECTS[name]
    mesh = solid_meshes.join_meshes(target.solids)
    triangles = mesh.vertices[mesh.triangles]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    grasps = antipodal_grasps(query(target, gripper, TABLE), SETTINGS)
    assert grasps
    for grasp in grasps:
        first, second = grasp.pose.contacts
        line = (second - first) / np.linalg.norm(second - first)
        for contact, direction in ((first, -line), (second, line)):
            nearest = trimesh.triangles.closest_point(triangles, np.tile(contact, (len(triangles), 1)))
            gaps = np.linalg.norm(nearest - contact, axis=1)
            assert gaps.min() < TOUCH_M, "the contact is on the surface"
            facing = (normals[gaps < gaps.min() + TOUCH_M] @ direction).max()
            assert facing >= SETTINGS.hand.cone_cosine - 0.02, (name, grasp)
        assert abs(line @ grasp.pose.axes[:, 0]) > 0.97, "the hand closes along the line of the contacts"
        assert grasp.pose.opening >= grasp.pose.width + 1.9 * SETTINGS.hand.min_finger_clearance_m
        assert np.linalg.norm(second - first) == pytest.approx(grasp.pose.width, abs=0.004)
        assert 0.0 <= grasp.quality <= 1.0
        assert np.allclose(grasp.pose.axes.T @ grasp.pose.axes, np.eye(3)) and np.linalg.det(grasp.pose.axes) > 0.0


def test_the_hand_comes_from_above_inclined_and_from_the_side() -> None:
    grasps = antipodal_grasps(query(OBJECTS["can"], geometry(*GRIPPERS[0]), TABLE), AntipodalSettings())
    angles = np.degrees([grasp.pose.approach_angle for grasp in grasps])
    assert (angles < 20).any() and ((angles > 20) & (angles < 70)).any() and (angles > 70).any()
    assert angles.max() <= np.degrees(SETTINGS.hand.max_approach_angle_rad) + 1e-6
    first = np.degrees([grasp.pose.approach_angle for grasp in grasps[:4]])
    assert len({int(angle // 24) for angle in first}) >= 3, "those to be checked first differ in their approach"


def test_the_greatest_angle_of_approach_holds() -> None:
    steep = replace(SETTINGS, hand=HandSettings(max_approach_angle_rad=math.radians(10)))
    grasps = antipodal_grasps(query(OBJECTS["box"], geometry(*GRIPPERS[0]), TABLE), steep)
    assert grasps and all(grasp.pose.approach_angle <= math.radians(10) for grasp in grasps)


def test_nothing_is_offered_where_the_hand_has_no_room() -> None:
    x, y = PLACE
    walls = [
        box("left", (0.02, 0.3, 0.3), (x - 0.055, y, TABLE_M + 0.15)),
        box("right", (0.02, 0.3, 0.3), (x + 0.055, y, TABLE_M + 0.15)),
        box("front", (0.3, 0.02, 0.3), (x, y - 0.055, TABLE_M + 0.15)),
        box("back", (0.3, 0.02, 0.3), (x, y + 0.055, TABLE_M + 0.15)),
    ]
    gripper = geometry(*GRIPPERS[0])
    assert antipodal_grasps(query(OBJECTS["can"], gripper, TABLE), SETTINGS)
    with pytest.raises(
        NoCandidatesError, match=r"^all \d+ hand poses that fit .* \d+ of them with '(left|right|front|back)'"
    ):
        antipodal_grasps(query(OBJECTS["can"], gripper, TABLE, *walls), SETTINGS)


def test_what_is_wider_than_the_gripper_opens_cannot_be_grasped() -> None:
    wide = placed("wide", surface_points.box((0.2, 0.2, 0.2)), [solid_meshes.box((0.2, 0.2, 0.2))])
    assert not antipodal_grasps(query(wide, geometry(*GRIPPERS[0]), TABLE), SETTINGS)


def test_the_seed_alone_decides_which_grasps_are_found() -> None:
    gripper = measure_gripper(ezgripper(), GRIPPERS[0][2], GRIPPERS[0][1])

    def found(seed: int) -> np.ndarray:
        grasps = antipodal_grasps(query(OBJECTS["can"], gripper, TABLE, seed=seed), SETTINGS)
        return np.array([[*grasp.pose.position, *grasp.pose.axes.ravel(), grasp.quality] for grasp in grasps])

    assert np.array_equal(found(3), found(3))
    assert found(3).shape != found(4).shape or not np.array_equal(found(3), found(4))
