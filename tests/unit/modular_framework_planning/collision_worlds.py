# SPDX-License-Identifier: BSD-3-Clause
"""Worlds of every kind of shape around the robot, which holds an object; verdicts on random states in them."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
import pinocchio as pin
import trimesh
from independent_checker import IndependentChecker, Part, Solid, box, cone, cylinder, mesh, sampled, sphere

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.geometry.shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

TIP = "wrist_3_link"
NEAR = 0.002  # [m]; nearer than that a free state may be refused
FINEST, DENSE = 4.0e-5, 4.0e-3  # [rad or m]; between samples of the checked edges, and of those of the second checker


@dataclass(frozen=True)
class Verdicts:
    """How many states or motions were looked at, and what was said of them."""

    asked: int = 0
    free: int = 0
    touching_called_free: int = 0
    refused_though_apart: int = 0
    refused_within_2_mm: int = 0

    def __add__(self, other: Verdicts) -> Verdicts:
        return Verdicts(*(one + two for one, two in zip(astuple(self), astuple(other), strict=True)))


def shape_of(kind: int, size: np.ndarray) -> tuple[Shape, Solid]:
    """A shape, and the same as FCL's geometry."""
    x, y, z = size.tolist()
    if kind == 0:
        return Box(x, y, z), box(x, y, z)
    if kind == 1:
        return Cylinder(z, x / 2), cylinder(x / 2, z)
    if kind == 2:
        return Sphere(x / 2), sphere(x / 2)
    if kind == 3:
        return Cone(z, x / 2), cone(x / 2, z)
    ring = trimesh.creation.annulus(r_min=x / 3, r_max=x / 2, height=z)
    vertices, faces = np.asarray(ring.vertices, dtype=float), np.asarray(ring.faces, dtype=np.int64)
    return Mesh(vertices, faces), mesh(vertices, faces)


def random_pose(rng: np.random.Generator) -> pin.SE3:
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 0.9)
    turn = pin.Quaternion(*(lambda q: q / np.linalg.norm(q))(rng.normal(size=4))).toRotationMatrix()
    return pin.SE3(turn, np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.8, 1.8)]))


def world_with(model: RobotModel, second: IndependentChecker, rng: np.random.Generator, held: int) -> PlanningScene:
    """Ten shapes of all kinds around the robot and one held object, for both checkers."""
    scene, world = empty_scene(model), []
    for number in range(10):
        shape, solid = shape_of(number % 5, rng.uniform(0.17, 0.3, 3))  # nothing fits inside a link
        pose = random_pose(rng)
        scene = scene.with_object(CollisionObject(f"thing{number}", pose, ((shape, pin.SE3.Identity()),)))
        world.append((f"thing{number}", solid, pose.homogeneous))
    second.set_world(world)
    shape, solid = shape_of(held, np.array([0.17, 0.17, 0.2]))
    pose = pin.SE3(np.eye(3), np.array([0.0, 0.25, 0.05]))
    touch = frozenset(
        link
        for link in model.document.links
        if model.has_link(link) and ("wrist_3" in link or "ee" in link or "ezgripper" in link or "tool" in link)
    )
    body = CollisionObject("held", pose, ((shape, pin.SE3.Identity()),))
    scene = scene.with_attached(AttachedObject(body, TIP, touch))
    robot_parts = [number for number, part in enumerate(second.parts) if part.link]
    things = [number for number, part in enumerate(second.parts) if not part.link]
    second.parts.append(Part("held", TIP, pose.homogeneous, solid))
    number = len(second.parts) - 1
    second.pairs += [(other, number) for other in things]
    second.pairs += [(other, number) for other in robot_parts if second.parts[other].link not in touch | {TIP}]
    return scene


def random_state(model: RobotModel, rng: np.random.Generator) -> np.ndarray:
    return model.with_mimics(rng.uniform(np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)))


def verdict(ours: ExactCollisionChecker, second: IndependentChecker, positions: np.ndarray) -> Verdicts:
    """What both checkers say of one state."""
    values = dict(zip(ours.model.joint_names, positions.tolist(), strict=True))
    free, touching = ours.is_free(positions), bool(second.collisions(values))
    refused = not free and not touching
    near = refused and second.distance(values) <= NEAR
    return Verdicts(1, free, free and touching, refused and not near, near)


@dataclass(frozen=True)
class Comparison:
    """Both checkers in one world.

    Attributes:
        moving: indices of the joints that get random values; the others stay at their defaults.
    """

    ours: ExactCollisionChecker
    second: IndependentChecker
    moving: np.ndarray

    def random_state(self, rng: np.random.Generator) -> np.ndarray:
        """A state with random values of the joints that move."""
        model = self.ours.model
        positions = model.default_positions()
        positions[self.moving] = random_state(model, rng)[self.moving]
        return model.with_mimics(positions)

    def states(self, rng: np.random.Generator, count: int) -> Verdicts:
        """What is said of random states."""
        return sum((verdict(self.ours, self.second, self.random_state(rng)) for _ in range(count)), Verdicts())

    def edges(self, rng: np.random.Generator, count: int) -> Verdicts:
        """What is said of random straight motions, most of them from free states."""
        model, total = self.ours.model, Verdicts()
        for number in range(count):
            start = self.random_state(rng)
            for _ in range(20):
                if number % 10 == 0 or self.ours.is_free(start):
                    break
                start = self.random_state(rng)
            end = start.copy()
            end[self.moving] += rng.normal(size=len(self.moving)) * rng.uniform(0.05, 0.4)
            total += self._edge(start, model.with_mimics(np.clip(end, model.lower, model.upper)))
        return total

    def _edge(self, start: np.ndarray, end: np.ndarray) -> Verdicts:
        """A free motion is sampled densely for the second checker; of a refused one, the state said to touch."""
        edge, names = np.array([start, end]), self.ours.model.joint_names
        touching = self.ours.colliding_state(edge, FINEST)
        if touching is None:
            rest = dict(zip(names, start.tolist(), strict=True))
            return Verdicts(1, 1, bool(self.second.touching_pairs(names, sampled(edge, DENSE), rest)))
        values = dict(zip(names, touching.tolist(), strict=True))
        if self.second.collisions(values):
            return Verdicts(1)
        near = self.second.distance(values) <= NEAR
        return Verdicts(1, 0, 0, not near, near)


def compared_in(scene: PlanningScene, second: IndependentChecker) -> Comparison:
    """Both checkers in a scene in which all joints move but those of a base."""
    moving = np.setdiff1d(np.arange(len(scene.model.joint_names)), scene.model.base_indices)
    return Comparison(ExactCollisionChecker(scene, moving), second, moving)


def compared_around(
    model: RobotModel, second: IndependentChecker, rng: np.random.Generator, moving: np.ndarray
) -> Comparison:
    """Both checkers among ten shapes of all kinds where the links that move most can be, when some joints move.

    Pairs of bodies that these joints do not move against each other are left out, as the first checker leaves them out.
    """
    scene, world = empty_scene(model), []
    home = Comparison(ExactCollisionChecker(scene, moving), second, moving)
    states = np.array([home.random_state(rng) for _ in range(20)])
    poses = second.link_poses(dict(zip(model.joint_names, states.T, strict=True)))
    spread = {part.link: float(np.ptp(poses[part.link][..., :3, 3], axis=0).max()) for part in second.parts}
    links = sorted(link for link, width in spread.items() if link and width > 0.5 * max(spread.values()))
    for number in range(10):
        shape, solid = shape_of(number % 5, rng.uniform(0.17, 0.3, 3))
        at = model.link_transforms(home.random_state(rng))[rng.choice(links)].translation
        pose = pin.SE3(random_pose(rng).rotation, at + rng.normal(size=3) * 0.15)
        scene = scene.with_object(CollisionObject(f"thing{number}", pose, ((shape, pin.SE3.Identity()),)))
        world.append((f"thing{number}", solid, pose.homogeneous))
    second.set_world(world)

    def moves(pair: tuple[int, int]) -> bool:
        first, other = (np.broadcast_to(poses[second.parts[k].link], (len(states), 4, 4)) for k in pair)
        between = np.linalg.inv(first) @ other
        return bool(np.abs(between - between[0]).max() > 1e-9)

    second.pairs = [pair for pair in second.pairs if moves(pair)]
    return Comparison(ExactCollisionChecker(scene, moving), second, moving)
