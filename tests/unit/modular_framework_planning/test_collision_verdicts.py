# SPDX-License-Identifier: BSD-3-Clause
"""Verdicts of the compiled collision check against a second checker, in worlds of every kind of shape and held objects."""
from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from independent_checker import IndependentChecker, Part, mesh_geometry

from modular_framework_planning.collision import CollisionChecker
from modular_framework_planning.motion_check import MotionChecker
from modular_framework_planning.planning_scene import AttachedObject, CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.urdf_document import package_resolver

WORLDS, STATES_PER_WORLD = 8, 250
TIP = "wrist_3_link"


@pytest.fixture(scope="module")
def second(robot: object) -> IndependentChecker:
    return IndependentChecker(robot.urdf, robot.srdf, package_resolver)


def shape_of(kind: int, size: np.ndarray) -> tuple[Shape, object, float]:
    """A shape, the same as Coal's geometry built apart, and its radius about the origin."""
    x, y, z = size.tolist()
    if kind == 0:
        return Box(x, y, z), coal.Box(x, y, z), float(np.linalg.norm(size)) / 2
    if kind == 1:
        return Cylinder(z, x / 2), coal.Cylinder(x / 2, z), float(np.hypot(x, z)) / 2
    if kind == 2:
        return Sphere(x / 2), coal.Sphere(x / 2), x / 2
    if kind == 3:
        return Cone(z, x / 2), coal.Cone(x / 2, z), float(np.hypot(x, z)) / 2
    mesh = trimesh.creation.annulus(r_min=x / 3, r_max=x / 2, height=z)
    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    return Mesh(vertices, faces), mesh_geometry(vertices, faces), float(np.linalg.norm(vertices, axis=1).max())


def random_pose(rng: np.random.Generator) -> pin.SE3:
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 0.9)
    turn = pin.Quaternion(*(lambda q: q / np.linalg.norm(q))(rng.normal(size=4))).toRotationMatrix()
    return pin.SE3(turn, np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.8, 1.8)]))


def world_with(model: RobotModel, second: IndependentChecker, rng: np.random.Generator, held: int) -> PlanningScene:
    """Ten shapes of all kinds around the robot and one held object, told to both checkers."""
    scene, world = empty_scene(model), []
    for number in range(10):
        shape, geometry, radius = shape_of(number % 5, rng.uniform(0.17, 0.3, 3))  # nothing fits inside a link
        pose = random_pose(rng)
        scene = scene.with_object(CollisionObject(f"thing{number}", pose, ((shape, pin.SE3.Identity()),)))
        world.append((f"thing{number}", geometry, radius, pose.homogeneous))
    second.set_world(world)
    shape, geometry, radius = shape_of(held, np.array([0.17, 0.17, 0.2]))
    pose = pin.SE3(np.eye(3), np.array([0.0, 0.25, 0.05]))
    touch = frozenset(link for link in model.document.links if model.has_link(link)
                      and ("wrist_3" in link or "ee" in link or "ezgripper" in link or "tool" in link))
    scene = scene.with_attached(AttachedObject(CollisionObject("held", pose, ((shape, pin.SE3.Identity()),)), TIP, touch))
    robot_parts = [number for number, part in enumerate(second.parts) if part.link]
    things = [number for number, part in enumerate(second.parts) if not part.link]
    second.parts.append(Part("held", TIP, pose.homogeneous, geometry, radius))
    number = len(second.parts) - 1
    second._pairs += [(other, number) for other in things]
    second._pairs += [(other, number) for other in robot_parts if second.parts[other].link not in touch | {TIP}]
    return scene


def smallest_distance(second: IndependentChecker, values: dict[str, float]) -> float:
    links = second.link_poses(values)
    poses = [links[part.link] @ part.pose for part in second.parts]
    best = np.inf
    for i, j in second._pairs:
        first, other = (coal.Transform3s(poses[k][:3, :3], poses[k][:3, 3]) for k in (i, j))
        best = min(best, coal.distance(second.parts[i].geometry, first, second.parts[j].geometry, other,
                                       coal.DistanceRequest(), coal.DistanceResult()))
    return float(best)


def random_state(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    return model.with_mimics(rng.uniform(np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)))


def test_no_touching_state_is_called_free_and_no_free_one_far_from_contact_is_refused(
        model: RobotModel, second: IndependentChecker) -> None:
    rng = np.random.default_rng(11)
    called_free = 0
    for number in range(WORLDS):
        scene = world_with(model, second, rng, number % 5)
        ours = CollisionChecker(scene)
        for _ in range(STATES_PER_WORLD):
            positions = random_state(model, rng)
            values = dict(zip(model.joint_names, positions.tolist(), strict=True))
            touching = bool(second.collisions(values))
            free = ours.is_free(positions)
            called_free += free
            assert not (free and touching)
            if not free and not touching:
                assert smallest_distance(second, values) <= 0.002
    assert called_free > 0.1 * WORLDS * STATES_PER_WORLD


def test_states_on_a_path_called_free_touch_nothing(model: RobotModel, second: IndependentChecker) -> None:
    rng = np.random.default_rng(12)
    scene = world_with(model, second, rng, 0)
    group = model.group("arm_and_manipulator")
    rest = model.default_positions()
    motion = MotionChecker(CollisionChecker(scene, group.indices), group.indices, rest)
    checked = 0
    for _ in range(150):
        start = rng.uniform(-np.pi, np.pi, len(group.joints))
        end = start + rng.normal(size=len(start)) * 0.3
        if not motion.edge_is_free(start, end, 0.02):
            continue
        count = int(np.ceil(np.abs(end - start).max() / 0.02))
        checked += count
        for number in range(1, count + 1):
            whole = motion.whole(start + number / count * (end - start))
            assert not second.collisions(dict(zip(model.joint_names, whole.tolist(), strict=True)))
    assert checked > 200
