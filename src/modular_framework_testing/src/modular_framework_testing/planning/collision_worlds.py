# SPDX-License-Identifier: BSD-3-Clause
"""Random worlds with all kinds of shapes, and verdicts of two collision checkers on states and motions in them."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
import pinocchio as pin
import trimesh

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.geometry.shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_checker import (
    IndependentChecker,
    Part,
    Solid,
    box,
    cone,
    cylinder,
    mesh,
    sampled_states,
    sphere,
)

TIP = "wrist_3_link"
NEAR = 0.002  # [m]; nearer than that a free state may be refused
FINEST, DENSE = 4.0e-5, 4.0e-3  # [rad or m]; between samples of edges: checked, and of the second checker


@dataclass(frozen=True)
class Verdicts:
    """Numbers of examined states or motions, by verdict.

    Attributes:
        asked: All.
        free: Called free.
        touching_called_free: Called free, but in collision for the second checker.
        refused_though_apart: Refused, but all bodies are more than `NEAR` apart.
        refused_within_2_mm: Refused, with bodies at most `NEAR` apart.
    """

    asked: int = 0
    free: int = 0
    touching_called_free: int = 0
    refused_though_apart: int = 0
    refused_within_2_mm: int = 0

    def __add__(self, other: Verdicts) -> Verdicts:
        return Verdicts(*(one + two for one, two in zip(astuple(self), astuple(other), strict=True)))


def shape_of(kind: int, size: np.ndarray) -> tuple[Shape, Solid]:
    """Returns a shape, for the planner and for the second checker.

    Args:
        kind: 0 to 4: box, cylinder, sphere, cone, ring as a mesh.
        size: Edge lengths of the box around the shape [m].
    """
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
    """Returns a pose 0.3 to 0.9 m from the vertical axis of the robot, with any orientation."""
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 0.9)
    turn = pin.Quaternion(*(lambda q: q / np.linalg.norm(q))(rng.normal(size=4))).toRotationMatrix()
    return pin.SE3(turn, np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.8, 1.8)]))


def world_with(model: RobotModel, second: IndependentChecker, rng: np.random.Generator, held: int) -> PlanningScene:
    """Puts ten shapes of all kinds around the robot and one into its hand, for both checkers.

    Args:
        model: Robot.
        second: Second checker of the robot; gets the same shapes.
        rng: Random generator of the world.
        held: Kind of the held shape, see `shape_of`.
    """
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
    """Returns positions of all joints, each within its limits and at most pi from zero."""
    return model.with_mimics(rng.uniform(np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)))


def verdict(ours: ExactCollisionChecker, second: IndependentChecker, positions: np.ndarray) -> Verdicts:
    """Compares the verdicts of both checkers on a state.

    Args:
        ours: Checker of the planner.
        second: Second checker.
        positions: Positions of all joints.
    """
    values = dict(zip(ours.model.joint_names, positions.tolist(), strict=True))
    free, touching = ours.is_free(positions), bool(second.collisions(values))
    refused = not free and not touching
    near = refused and second.distance(values) <= NEAR
    return Verdicts(1, free, free and touching, refused and not near, near)


@dataclass(frozen=True)
class Comparison:
    """Both checkers in one world.

    Attributes:
        ours: Checker of the planner.
        second: Second checker.
        moving: Indices of the joints with random values; the others stay at their defaults.
    """

    ours: ExactCollisionChecker
    second: IndependentChecker
    moving: np.ndarray

    def random_state(self, rng: np.random.Generator) -> np.ndarray:
        """Returns a state with random values of the moving joints."""
        model = self.ours.model
        positions = model.default_positions()
        positions[self.moving] = random_state(model, rng)[self.moving]
        return model.with_mimics(positions)

    def states(self, rng: np.random.Generator, count: int) -> Verdicts:
        """Returns the verdicts on random states."""
        return sum((verdict(self.ours, self.second, self.random_state(rng)) for _ in range(count)), Verdicts())

    def edges(self, rng: np.random.Generator, count: int) -> Verdicts:
        """Returns the verdicts on random straight motions, most of them from free states."""
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
        """The second checker gets dense samples of a free motion, and the colliding state of a refused motion."""
        edge, names = np.array([start, end]), self.ours.model.joint_names
        touching = self.ours.colliding_state(edge, FINEST)
        if touching is None:
            rest = dict(zip(names, start.tolist(), strict=True))
            return Verdicts(1, 1, bool(self.second.touching_pairs(names, sampled_states(edge, DENSE), rest)))
        values = dict(zip(names, touching.tolist(), strict=True))
        if self.second.collisions(values):
            return Verdicts(1)
        near = self.second.distance(values) <= NEAR
        return Verdicts(1, 0, 0, not near, near)


def compared_in(scene: PlanningScene, second: IndependentChecker) -> Comparison:
    """Compares both checkers in a scene; all joints move except those of a base."""
    moving = np.setdiff1d(np.arange(len(scene.model.joint_names)), scene.model.base_indices)
    return Comparison(ExactCollisionChecker(scene, moving), second, moving)


def compared_around(
    model: RobotModel, second: IndependentChecker, rng: np.random.Generator, moving: np.ndarray
) -> Comparison:
    """Compares both checkers among ten shapes of all kinds, within reach of the links that move most.

    Pairs of bodies without relative motion are left out, as in the checker of the planner.

    Args:
        model: Robot.
        second: Second checker of the robot; gets the same shapes.
        rng: Random generator of the world.
        moving: Indices of the joints that move.
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
