# SPDX-License-Identifier: BSD-3-Clause
"""Tracks the objects of the planning scene in messages of `monitored_planning_scene`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modular_framework_simulation.models.drawn_bodies import (
    DrawnBody,
    drawn_box,
    drawn_cylinder,
    drawn_plane,
    drawn_sphere,
)
from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_simulation.models.sdf_specs import Colour
from modular_framework_simulation.viewer.glb_files import PlacedBody

FREE_COLOUR: Colour = (0.2, 0.8, 0.3, 0.3)
"""Colour of an object of the world, green as in RViz; transparent, because the object covers its visual shape."""
ATTACHED_COLOUR: Colour = (0.7, 0.3, 0.9, 0.55)
"""Colour of an attached object."""
_PLANE_SIZE_M = 4.0


@dataclass(frozen=True, slots=True)
class SceneObject:
    """Object of the planning scene.

    Attributes:
        frame: Reference frame of the pose: a robot link, or the frame of the scene.
        pose: Pose of the object in the reference frame.
        bodies: Shapes of the object, in the object frame.
        attached: Whether the object is attached to the robot.
    """

    frame: str
    pose: Pose
    bodies: tuple[PlacedBody, ...]
    attached: bool


class PlanningSceneObjects:
    """Objects of the planning scene, updated by moveit_msgs/PlanningScene messages.

    Attributes:
        objects: Objects by name.
    """

    def __init__(self) -> None:
        self.objects: dict[str, SceneObject] = {}

    def apply(self, message: Any) -> list[str]:
        """Applies a complete scene or a difference.

        Returns:
            Faults of objects in the message; the objects of these names are not changed.
        """
        if not message.is_diff:
            self.objects.clear()
        elif not message.robot_state.is_diff:  # a complete robot state contains all attached objects
            self._remove_attached()
        faults = []
        attached = message.robot_state.attached_collision_objects
        for item, link in [(each, "") for each in message.world.collision_objects] + [
            (each.object, each.link_name) for each in attached
        ]:
            try:
                self._apply_object(item, link)
            except ValueError as error:
                faults.append(f"object '{item.id[:100]}': {error}")
        return faults

    def _remove_attached(self) -> None:
        self.objects = {name: each for name, each in self.objects.items() if not each.attached}

    def _apply_object(self, item: Any, link: str) -> None:
        known = self.objects.get(item.id)
        if item.operation == item.REMOVE:
            if not item.id and link:
                self._remove_attached()
            elif not item.id:
                self.objects = {name: each for name, each in self.objects.items() if each.attached}
            elif known is not None and known.attached == bool(link):
                del self.objects[item.id]
            return
        pose, frame = _pose(item.pose), item.header.frame_id.lstrip("/") or link
        if item.operation == item.MOVE:
            if known is None:
                raise ValueError("is moved, but does not exist")
            self.objects[item.id] = replace(known, pose=pose, frame=frame)
            return
        bodies = _bodies(item)
        if link and not bodies and known is not None:  # attaches an existing object of the world
            self.objects[item.id] = replace(known, attached=True)
            return
        if item.operation == item.APPEND and known is not None:
            bodies = known.bodies + bodies
        self.objects[item.id] = SceneObject(frame, pose, bodies, bool(link))


def _bodies(item: Any) -> tuple[PlacedBody, ...]:
    bodies: list[PlacedBody] = []
    for shapes, poses, body_of in (
        (item.primitives, item.primitive_poses, _primitive),
        (item.meshes, item.mesh_poses, _mesh),
        (item.planes, item.plane_poses, _plane),
    ):
        if len(poses) not in (len(shapes), 0):
            raise ValueError(f"{len(shapes)} shapes have {len(poses)} poses; expected one pose per shape")
        for index, shape in enumerate(shapes):
            bodies.append((_pose(poses[index]) if poses else Pose(), body_of(shape)))
    return tuple(bodies)


def _primitive(primitive: Any) -> DrawnBody:
    count = {primitive.BOX: 3, primitive.SPHERE: 1, primitive.CYLINDER: 2, primitive.CONE: 2}.get(primitive.type)
    sizes = [float(value) for value in primitive.dimensions]
    if count is None or len(sizes) < count or not all(math.isfinite(size) and size > 0 for size in sizes):
        raise ValueError(f"primitive of type {primitive.type} has dimensions {sizes}; expected positive numbers")
    if primitive.type == primitive.BOX:
        return drawn_box(np.array(sizes[:3]), FREE_COLOUR, None)
    if primitive.type == primitive.SPHERE:
        return drawn_sphere(sizes[0], FREE_COLOUR, None)
    if primitive.type == primitive.CONE:
        return _cone(sizes[0], sizes[1])
    return drawn_cylinder(sizes[1], sizes[0], FREE_COLOUR, None)


def _cone(height: float, radius: float) -> DrawnBody:
    """Returns a cone, made from a cylinder by moving its upper rim to the axis."""
    body = drawn_cylinder(radius, height, FREE_COLOUR, None)
    vertices = body.vertices.copy()
    vertices[vertices[:, 2] > 0, :2] = 0.0
    return replace(body, vertices=vertices)


def _mesh(mesh: Any) -> DrawnBody:
    vertices = np.array([(each.x, each.y, each.z) for each in mesh.vertices], dtype=np.float64).reshape(-1, 3)
    triangles = np.array([each.vertex_indices for each in mesh.triangles], dtype=np.int64).reshape(-1, 3)
    if not np.isfinite(vertices).all() or (len(triangles) and triangles.max() >= len(vertices)):
        raise ValueError(f"a mesh refers to more than its {len(vertices)} vertices, or has vertices that are infinite")
    return DrawnBody(vertices, triangles, None, None, FREE_COLOUR, None)


def _plane(plane: Any) -> DrawnBody:
    a, b, c, d = (float(value) for value in plane.coef)
    length = math.hypot(a, b, c)
    if not (math.isfinite(length) and math.isfinite(d)) or length == 0.0:
        raise ValueError(f"plane {[a, b, c, d]} has no normal")
    normal = np.array((a, b, c)) / length
    body = drawn_plane(normal, (_PLANE_SIZE_M, _PLANE_SIZE_M), FREE_COLOUR, None)
    return replace(body, vertices=body.vertices - normal * d / length)


def _pose(message: Any) -> Pose:
    p, q = message.position, message.orientation
    if not all(map(math.isfinite, (p.x, p.y, p.z))):
        raise ValueError(f"position {[p.x, p.y, p.z]} is not finite")
    return Pose((p.x, p.y, p.z), normalised_quaternion((q.x, q.y, q.z, q.w)))
