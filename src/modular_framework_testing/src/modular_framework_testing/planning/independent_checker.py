# SPDX-License-Identifier: BSD-3-Clause
"""A second collision checker: its own forward kinematics of many states at once, one FCL call per pair of bodies.

Shares with the planner only the reader of mesh files and the refusal of DOCTYPEs. Pairs are left out if a sphere around
a body does not reach the box around the other body.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import fcl
import numpy as np

from modular_framework_urdf.mesh_reader import read_mesh
from modular_framework_urdf.xml_text import refuse_doctype

STATES_AT_ONCE = 500


@dataclass
class Solid:
    """A geometry of FCL, and its bounding box in the frame of the geometry: half lengths and centre [m]."""

    geometry: object
    half: np.ndarray
    middle: np.ndarray


@dataclass
class Part:
    """A collision geometry: body, parent link ("" for the world), pose in the link, geometry."""

    body: str
    link: str
    pose: np.ndarray
    solid: Solid


def box(x: float, y: float, z: float) -> Solid:
    """Returns a box.

    Args:
        x: Edge length along x [m].
        y: Edge length along y [m].
        z: Edge length along z [m].
    """
    return Solid(fcl.Box(x, y, z), np.array([x, y, z]) / 2.0, np.zeros(3))


def sphere(radius: float) -> Solid:
    """Returns a sphere."""
    return Solid(fcl.Sphere(radius), np.full(3, radius), np.zeros(3))


def cylinder(radius: float, height: float) -> Solid:
    """Returns a cylinder along z."""
    return Solid(fcl.Cylinder(radius, height), np.array([radius, radius, height / 2.0]), np.zeros(3))


def cone(radius: float, height: float) -> Solid:
    """Returns a cone along z."""
    return Solid(fcl.Cone(radius, height), np.array([radius, radius, height / 2.0]), np.zeros(3))


def mesh(vertices: np.ndarray, triangles: np.ndarray) -> Solid:
    """Returns a triangle mesh."""
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(triangles))
    model.addSubModel(np.asarray(vertices, float), np.asarray(triangles, np.int32))
    model.endModel()
    low, high = np.min(vertices, axis=0), np.max(vertices, axis=0)
    return Solid(model, (high - low) / 2.0, (high + low) / 2.0)


def pose_matrix(xyz: Sequence[float], rotation: np.ndarray) -> np.ndarray:
    """Returns a homogeneous transform."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, xyz
    return result


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Returns the rotation about the fixed axes x, then y, then z.

    Args:
        roll: Angle about x [rad].
        pitch: Angle about y [rad].
        yaw: Angle about z [rad].
    """
    return axis_matrix([0, 0, 1], yaw) @ axis_matrix([0, 1, 0], pitch) @ axis_matrix([1, 0, 0], roll)


def axis_matrix(axis: Sequence[float], angle: float) -> np.ndarray:
    """Returns the rotation about an axis, by Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def quaternion_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Returns the rotation of a quaternion of any length.

    Args:
        x: Component x.
        y: Component y.
        z: Component z.
        w: Component w.
    """
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    angle = 2 * np.arctan2(np.sqrt(x * x + y * y + z * z) / norm, w / norm)
    return np.eye(3) if abs(angle) < 1e-12 else axis_matrix([x, y, z], angle)


@dataclass(frozen=True)
class _Joint:
    """A joint: name, type, parent link, pose in the parent, axis, and the (joint, multiplier, offset) it mimics."""

    name: str
    kind: str
    parent: str
    origin: np.ndarray
    axis: Sequence[float]
    mimic: tuple[str, float, float] | None = None


def _text(element: ET.Element, key: str) -> str:
    """Returns an attribute that the formats require."""
    return element.attrib[key]


def _child(element: ET.Element, name: str) -> ET.Element:
    """Returns a child element that the formats require."""
    return next(element.iter(name))


def _joint(element: ET.Element) -> _Joint:
    mimic = element.find("mimic")
    return _Joint(
        _text(element, "name"),
        _text(element, "type"),
        _text(_child(element, "parent"), "link"),
        _origin(element),
        _floats(element.find("axis"), "xyz", "1 0 0"),
        None
        if mimic is None
        else (_text(mimic, "joint"), float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))),
    )


def _floats(element: ET.Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(value) for value in text.split()]


def _origin(element: ET.Element) -> np.ndarray:
    origin = element.find("origin")
    return pose_matrix(_floats(origin, "xyz", "0 0 0"), rpy_matrix(*_floats(origin, "rpy", "0 0 0")))


def _motion(kind: str, axis: Sequence[float], values: np.ndarray) -> np.ndarray:
    """Returns the transform of a joint at each of its values, shape (..., 4, 4)."""
    result = np.zeros((*values.shape, 4, 4)) + np.eye(4)
    if kind in ("revolute", "continuous"):
        x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        sine, versine = np.sin(values)[..., None, None], 1.0 - np.cos(values)[..., None, None]
        result[..., :3, :3] += sine * cross + versine * (cross @ cross)
    elif kind == "prismatic":
        result[..., :3, 3] = values[..., None] * np.asarray(axis)
    return result


World = Iterable[tuple[str, Solid, np.ndarray]]


class IndependentChecker:
    """Collision checks of the robot of a URDF and an SRDF, and of solids around it."""

    def __init__(self, urdf: str, srdf: str, resolve: Callable[[str], str]) -> None:
        refuse_doctype(urdf, "URDF")
        refuse_doctype(srdf, "SRDF")
        root, semantics = ET.fromstring(urdf), ET.fromstring(srdf)
        self._joints = {_text(_child(joint, "child"), "link"): _joint(joint) for joint in root.findall("joint")}
        self._links = [_text(link, "name") for link in root.findall("link")]
        self._add_base(semantics)
        self.parts: list[Part] = []
        for link in root.findall("link"):
            for collision in link.findall("collision"):
                name, geometry = _text(link, "name"), _child(collision, "geometry")
                self.parts.append(Part(name, name, _origin(collision), self._read(geometry, resolve)))
        self._allowed = {frozenset((e.get("link1"), e.get("link2"))) for e in semantics.iter("disable_collisions")}
        self._robot_parts = len(self.parts)
        self.pairs = self._robot_pairs()

    def _add_base(self, semantics: ET.Element) -> None:
        """Puts the variables of a planar or floating virtual joint above the root link, the outermost first."""
        turns = {"planar": ("theta",), "floating": ("yaw", "pitch", "roll")}
        slides = {"planar": ("x", "y"), "floating": ("trans_x", "trans_y", "trans_z")}
        axes = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1], "theta": [0, 0, 1], "yaw": [0, 0, 1]}
        axes |= {"pitch": [0, 1, 0], "roll": [1, 0, 0]}
        root = next(link for link in self._links if link not in self._joints)
        for joint in semantics.iter("virtual_joint"):
            kind, name = joint.get("type"), joint.get("name")
            if joint.get("child_link") != root or kind not in turns:
                continue
            variables, child = (*slides[kind], *turns[kind]), root
            for number in reversed(range(len(variables))):
                variable = variables[number]
                motion = "prismatic" if variable in slides[kind] else "continuous"
                axis = axes[variable.removeprefix("trans_")]
                parent = f"{name}/{variables[number - 1]}" if number else ""
                self._joints[child] = _Joint(f"{name}/{variable}", motion, parent, np.eye(4), axis)
                child = parent
            break

    @staticmethod
    def _read(geometry: ET.Element, resolve: Callable[[str], str]) -> Solid:
        shape = geometry[0]
        if shape.tag == "mesh":
            x, y, z = _floats(shape, "scale", "1 1 1")
            read = read_mesh(resolve(_text(shape, "filename")), (x, y, z))
            return mesh(read.vertices, read.triangles)
        if shape.tag == "box":
            return box(*_floats(shape, "size", ""))
        if shape.tag == "sphere":
            return sphere(float(_text(shape, "radius")))
        return cylinder(float(_text(shape, "radius")), float(_text(shape, "length")))

    def _moving_root(self, link: str) -> str:
        while link in self._joints and self._joints[link].kind == "fixed":
            link = self._joints[link].parent
        return link

    def _robot_pairs(self) -> list[tuple[int, int]]:
        roots = [self._moving_root(part.link) for part in self.parts]
        return [
            (i, j)
            for i in range(len(self.parts))
            for j in range(i + 1, len(self.parts))
            if roots[i] != roots[j] and frozenset((self.parts[i].link, self.parts[j].link)) not in self._allowed
        ]

    def set_world(self, objects: World, base_moves: bool = False) -> None:
        """Replaces the world: name, solid, pose in the planning frame; only a moving base can touch the world."""
        self.parts = self.parts[: self._robot_parts]
        self.pairs = self._robot_pairs()
        base = self._moving_root(self._links[0])
        for name, solid, pose in objects:
            self.parts.append(Part(name, "", pose, solid))
            self.pairs += [
                (i, len(self.parts) - 1)
                for i in range(self._robot_parts)
                if base_moves or self._moving_root(self.parts[i].link) != base
            ]

    def link_poses(self, positions: Mapping[str, float | np.ndarray]) -> dict[str, np.ndarray]:
        """Forward kinematics of one state, or of many where positions are arrays; poses of shape (..., 4, 4).

        Joints that are not named are at 0, mimic joints follow unless named.
        """
        shape = np.broadcast_shapes(*(np.shape(value) for value in positions.values()))
        poses: dict[str, np.ndarray] = {"": np.broadcast_to(np.eye(4), (*shape, 4, 4))}

        def pose(link: str) -> np.ndarray:
            if link not in poses:
                if link not in self._joints:
                    poses[link] = poses[""]
                    return poses[link]
                joint = self._joints[link]
                value = positions.get(joint.name, 0.0)
                if joint.mimic is not None and joint.name not in positions:
                    leader, multiplier, offset = joint.mimic
                    value = multiplier * positions.get(leader, 0.0) + offset
                motion = _motion(joint.kind, joint.axis, np.asarray(value, float))
                poses[link] = pose(joint.parent) @ joint.origin @ motion
            return poses[link]

        for link in self._links:
            pose(link)
        return poses

    def _part_poses(self, positions: Mapping[str, float | np.ndarray], count: int) -> np.ndarray:
        """Poses of the parts in each state, shape (count, parts, 4, 4)."""
        links = self.link_poses(positions)
        return np.stack([np.broadcast_to(links[part.link] @ part.pose, (count, 4, 4)) for part in self.parts], axis=1)

    def _near(self, poses: np.ndarray) -> np.ndarray:
        """Which pairs may touch, shape (states, pairs): the sphere around each reaches the box around the other."""
        pairs = np.array(self.pairs)
        half, middle = (np.array([getattr(part.solid, key) for part in self.parts]) for key in ("half", "middle"))
        radii = np.linalg.norm(half, axis=1)
        centres = np.einsum("spij,pj->spi", poses[..., :3, :3], middle) + poses[..., :3, 3]
        near = np.ones((len(poses), len(pairs)), dtype=bool)
        for ball, other in (pairs.T, pairs.T[::-1]):
            offset = np.einsum("spji,spj->spi", poses[:, other, :3, :3], centres[:, ball] - centres[:, other])
            gap = np.linalg.norm(np.maximum(np.abs(offset) - half[other], 0.0), axis=2)
            near &= gap <= radii[ball] + 1e-9
        return near

    def _touch(self, pair: tuple[int, int], poses: np.ndarray) -> bool:
        first, second = (
            fcl.CollisionObject(self.parts[k].solid.geometry, fcl.Transform(poses[k, :3, :3], poses[k, :3, 3]))
            for k in pair
        )
        return fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()) > 0

    def collisions(self, positions: Mapping[str, float], first_only: bool = True) -> list[tuple[str, str]]:
        """Pairs of bodies that touch."""
        poses = self._part_poses(positions, 1)
        found = []
        for number in np.flatnonzero(self._near(poses)[0]):
            i, j = self.pairs[number]
            if self._touch((i, j), poses[0]):
                found.append((self.parts[i].body, self.parts[j].body))
                if first_only:
                    break
        return found

    def distance(self, positions: Mapping[str, float]) -> float:
        """The smallest distance of bodies that may not touch [m]; 0 or less if bodies touch."""
        poses, best = self._part_poses(positions, 1)[0], np.inf
        for pair in self.pairs:
            first, second = (
                fcl.CollisionObject(self.parts[k].solid.geometry, fcl.Transform(poses[k, :3, :3], poses[k, :3, 3]))
                for k in pair
            )
            best = min(best, fcl.distance(first, second, fcl.DistanceRequest(), fcl.DistanceResult()))
        return float(best)

    def depths(self, positions: Mapping[str, float], bodies: tuple[str, str]) -> list[float]:
        """Returns the penetration depth of each contact of two bodies in a state [m]."""
        poses = self._part_poses(positions, 1)[0]
        result = fcl.CollisionResult()
        for pair in self.pairs:
            if {self.parts[k].body for k in pair} == set(bodies):
                first, second = (
                    fcl.CollisionObject(self.parts[k].solid.geometry, fcl.Transform(poses[k, :3, :3], poses[k, :3, 3]))
                    for k in pair
                )
                fcl.collide(first, second, fcl.CollisionRequest(num_max_contacts=100, enable_contact=True), result)
        return [contact.penetration_depth for contact in result.contacts]

    def touching_pairs(
        self, joint_names: Sequence[str], samples: np.ndarray, rest: Mapping[str, float]
    ) -> dict[int, tuple[str, str]]:
        """Finds the colliding states.

        Args:
            joint_names: Names of the joints in the columns of `samples`.
            samples: States, shape (n, joints).
            rest: Positions of the other joints, by name.

        Returns:
            Index of each colliding state -> the first pair of colliding bodies.
        """
        found: dict[int, tuple[str, str]] = {}
        for begin in range(0, len(samples), STATES_AT_ONCE):
            some = samples[begin : begin + STATES_AT_ONCE]
            poses = self._part_poses({**rest, **dict(zip(joint_names, some.T, strict=True))}, len(some))
            for state, number in np.argwhere(self._near(poses)):
                if begin + state not in found and self._touch(self.pairs[number], poses[state]):
                    found[begin + int(state)] = tuple(self.parts[k].body for k in self.pairs[number])
        return found

    def colliding_states(
        self, joint_names: Sequence[str], path: np.ndarray, rest: Mapping[str, float], step: float = 0.01
    ) -> int:
        """Counts the colliding states along a path.

        Args:
            joint_names: Names of the joints in the columns of `path`.
            path: Vertices, shape (n, joints).
            rest: Positions of the other joints, by name.
            step: Maximum difference of a joint between samples [rad or m].
        """
        return len(self.touching_pairs(joint_names, sampled_states(path, step), rest))


def sampled_states(path: np.ndarray, step: float) -> np.ndarray:
    """Returns states on the straight pieces of a path, vertices included, at most `step` apart in every joint."""
    rows = []
    for start, end in zip(path[:-1], path[1:], strict=True):
        pieces = max(1, int(np.ceil(np.abs(end - start).max() / step)))
        rows.append(start + np.arange(pieces)[:, None] / pieces * (end - start))
    return np.vstack([*rows, path[-1:]])
