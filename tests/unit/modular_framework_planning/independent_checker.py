# SPDX-License-Identifier: BSD-3-Clause
"""A second opinion on collisions: own forward kinematics, meshes read by trimesh, one Coal call per pair of bodies.

It shares no code with the planner. Far pairs are left out by bounding spheres only.
"""
from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import coal
import numpy as np
import trimesh


@dataclass
class Part:
    """One collision geometry: body, link it hangs on ("" = world), pose there, geometry, radius around its origin."""

    body: str
    link: str
    pose: np.ndarray
    geometry: object
    radius: float


def pose_matrix(xyz: Sequence[float], rotation: np.ndarray) -> np.ndarray:
    """Homogeneous transform."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, xyz
    return result


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation about fixed x, then y, then z."""
    return axis_matrix([0, 0, 1], yaw) @ axis_matrix([0, 1, 0], pitch) @ axis_matrix([1, 0, 0], roll)


def axis_matrix(axis: Sequence[float], angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def quaternion_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Rotation of an xyzw quaternion."""
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    angle = 2 * np.arctan2(np.sqrt(x * x + y * y + z * z) / norm, w / norm)
    return np.eye(3) if abs(angle) < 1e-12 else axis_matrix([x, y, z], angle)


def _floats(element: ET.Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(value) for value in text.split()]


def _origin(element: ET.Element) -> np.ndarray:
    origin = element.find("origin")
    return pose_matrix(_floats(origin, "xyz", "0 0 0"), rpy_matrix(*_floats(origin, "rpy", "0 0 0")))


def mesh_geometry(vertices: np.ndarray, triangles: np.ndarray) -> object:
    """A Coal triangle mesh."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    model.addVertices(np.asarray(vertices, float))
    model.addTriangles(np.asarray(triangles, np.int64))
    model.endModel()
    return model


class IndependentChecker:
    """The robot of a URDF and SRDF, and boxes and cylinders around it."""

    def __init__(self, urdf: str, srdf: str, resolve: Callable[[str], str]) -> None:
        root, semantics = ET.fromstring(urdf), ET.fromstring(srdf)
        self._joints = {}
        for joint in root.findall("joint"):
            axis = _floats(joint.find("axis"), "xyz", "1 0 0")
            mimic = joint.find("mimic")
            self._joints[joint.find("child").get("link")] = (
                joint.get("name"), joint.get("type"), joint.find("parent").get("link"), _origin(joint), axis,
                None if mimic is None else (mimic.get("joint"), float(mimic.get("multiplier", 1)),
                                            float(mimic.get("offset", 0))))
        self._links = [link.get("name") for link in root.findall("link")]
        self.parts: list[Part] = []
        for link in root.findall("link"):
            for collision in link.findall("collision"):
                geometry, radius = self._read(collision.find("geometry"), resolve)
                name = link.get("name")
                self.parts.append(Part(name, name, _origin(collision), geometry, radius))
        self._allowed = {frozenset((e.get("link1"), e.get("link2"))) for e in semantics.iter("disable_collisions")}
        self._robot_parts = len(self.parts)
        self._pairs = self._robot_pairs()

    @staticmethod
    def _read(geometry: ET.Element, resolve: Callable[[str], str]) -> tuple[object, float]:
        shape = geometry[0]
        if shape.tag == "mesh":
            mesh = trimesh.load(resolve(shape.get("filename")), force="mesh", process=False)
            vertices = np.asarray(mesh.vertices) * _floats(shape, "scale", "1 1 1")
            return mesh_geometry(vertices, mesh.faces), float(np.linalg.norm(vertices, axis=1).max())
        if shape.tag == "box":
            size = _floats(shape, "size", "")
            return coal.Box(*size), float(np.linalg.norm(size)) / 2
        if shape.tag == "sphere":
            return coal.Sphere(float(shape.get("radius"))), float(shape.get("radius"))
        radius, length = float(shape.get("radius")), float(shape.get("length"))
        return coal.Cylinder(radius, length), float(np.hypot(radius, length / 2))

    def _moving_root(self, link: str) -> str:
        while link in self._joints and self._joints[link][1] == "fixed":
            link = self._joints[link][2]
        return link

    def _robot_pairs(self) -> list[tuple[int, int]]:
        roots = [self._moving_root(part.link) for part in self.parts]
        return [(i, j) for i in range(len(self.parts)) for j in range(i + 1, len(self.parts))
                if roots[i] != roots[j]
                and frozenset((self.parts[i].link, self.parts[j].link)) not in self._allowed]

    def set_world(self, objects: Iterable[tuple[str, object, float, np.ndarray]]) -> None:
        """Replaces the world: name, Coal geometry, radius around its origin, pose in the root frame."""
        self.parts = self.parts[:self._robot_parts]
        self._pairs = self._robot_pairs()
        base = self._moving_root(self._links[0])
        for name, geometry, radius, pose in objects:
            self.parts.append(Part(name, "", pose, geometry, radius))
            self._pairs += [(i, len(self.parts) - 1) for i in range(self._robot_parts)
                            if self._moving_root(self.parts[i].link) != base]

    def link_poses(self, positions: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Forward kinematics; joints that are not named are at 0, mimic joints follow unless named."""
        poses: dict[str, np.ndarray] = {"": np.eye(4)}

        def pose(link: str) -> np.ndarray:
            if link not in poses:
                if link not in self._joints:
                    poses[link] = np.eye(4)
                    return poses[link]
                name, kind, parent, origin, axis, mimic = self._joints[link]
                value = positions.get(name, 0.0)
                if mimic is not None and name not in positions:
                    value = mimic[1] * positions.get(mimic[0], 0.0) + mimic[2]
                motion = np.eye(4)
                if kind in ("revolute", "continuous"):
                    motion[:3, :3] = axis_matrix(axis, value)
                elif kind == "prismatic":
                    motion[:3, 3] = np.asarray(axis) * value
                poses[link] = pose(parent) @ origin @ motion
            return poses[link]

        for link in self._links:
            pose(link)
        return poses

    def collisions(self, positions: Mapping[str, float], first_only: bool = True) -> list[tuple[str, str]]:
        """Pairs of bodies that touch."""
        links = self.link_poses(positions)
        poses = [links[part.link] @ part.pose for part in self.parts]
        pairs = np.array(self._pairs)
        centres = np.array([pose[:3, 3] for pose in poses])
        radii = np.array([part.radius for part in self.parts])
        gaps = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
        found = []
        for i, j in pairs[gaps <= radii[pairs[:, 0]] + radii[pairs[:, 1]]]:
            first, second = (coal.Transform3s(poses[k][:3, :3], poses[k][:3, 3]) for k in (i, j))
            if coal.collide(self.parts[i].geometry, first, self.parts[j].geometry, second, coal.CollisionRequest(),
                            coal.CollisionResult()):
                found.append((self.parts[i].body, self.parts[j].body))
                if first_only:
                    break
        return found

    def colliding_states(self, joint_names: Sequence[str], path: np.ndarray, rest: Mapping[str, float],
                         step: float = 0.01) -> int:
        """Counts colliding states on the straight pieces of a path, sampled at most `step` apart in every joint."""
        count = 0
        for start, end in zip(path[:-1], path[1:], strict=True):
            pieces = max(1, int(np.ceil(np.abs(end - start).max() / step)))
            for number in range(pieces):
                values = start + number / pieces * (end - start)
                count += bool(self.collisions({**rest, **dict(zip(joint_names, values, strict=True))}))
        return count + bool(self.collisions({**rest, **dict(zip(joint_names, path[-1], strict=True))}))
