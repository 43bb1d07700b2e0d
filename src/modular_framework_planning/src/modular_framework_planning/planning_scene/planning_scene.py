# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene as immutable snapshots, so that a running plan never sees a partial change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import count

import numpy as np

from modular_framework_planning.errors import ErrorCode, GeometryError, UnknownNameError
from modular_framework_planning.geometry.shapes import Mesh, Plane, Shape
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix, matrix_from_semantics
from modular_framework_planning.planning_scene.padding import Padding
from modular_framework_planning.robot_model.robot_model import MAX_CACHED_MODELS, RobotModel

_versions = count(1)
OCTOMAP_ID = "<octomap>"
DEFAULT_NAME = "(noname)"
Color = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class CollisionObject:
    """A body in the world.

    Attributes:
        name: Id of the object.
        pose: Pose of the object in the planning frame, or in the link's frame if attached.
        shapes: Shapes with their poses in the object's frame.
        subframes: Named poses in the object's frame.
    """

    name: str
    pose: Transform
    shapes: tuple[tuple[Shape, Transform], ...]
    subframes: Mapping[str, Transform] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class AttachedObject:
    """A body that moves with a link and may touch this link and all `touch_links`."""

    body: CollisionObject
    link: str
    touch_links: frozenset[str]

    @property
    def name(self) -> str:
        """Id of the attached body."""
        return self.body.name


@dataclass(frozen=True, slots=True, eq=False)
class PlanningScene:
    """Snapshot of objects, attached objects, allowed collisions and the robot's joint positions.

    Every `with_...` or `without_...` method returns a new snapshot with a new version number.
    `geometry_version` changes whenever the result of a collision check may change.
    """

    model: RobotModel
    positions: Array
    acm: AllowedCollisionMatrix
    objects: Mapping[str, CollisionObject] = field(default_factory=dict)
    attached: Mapping[str, AttachedObject] = field(default_factory=dict)
    colors: Mapping[str, Color] = field(default_factory=dict)
    fixed_frames: Mapping[str, Transform] = field(default_factory=dict)
    padding: Padding = field(default_factory=Padding)
    octomap: CollisionObject | None = None
    name: str = DEFAULT_NAME
    version: int = 0
    geometry_version: int = 0

    def _replace_fields(self, **changes: object) -> PlanningScene:
        version = next(_versions)
        geometry_version = self.geometry_version
        if changes.keys() & {"objects", "attached", "acm", "padding", "octomap"}:
            geometry_version = version
        return replace(self, version=version, geometry_version=geometry_version, **changes)  # type: ignore[arg-type]

    def with_positions(self, positions: Array) -> PlanningScene:
        """Returns the scene with new joint positions of the robot [rad or m]."""
        return self._replace_fields(positions=positions)

    def with_acm(self, acm: AllowedCollisionMatrix) -> PlanningScene:
        """Returns the scene with a new allowed collision matrix."""
        return self._replace_fields(acm=acm)

    def with_name(self, name: str) -> PlanningScene:
        """Returns the scene with a new name."""
        return self._replace_fields(name=name)

    def with_colors(self, colors: Mapping[str, Color]) -> PlanningScene:
        """Returns the scene with additional colours of objects (r, g, b, a in 0..1)."""
        return self._replace_fields(colors={**self.colors, **colors})

    def with_fixed_frames(self, frames: Mapping[str, Transform]) -> PlanningScene:
        """Returns the scene with additional named frames, given in the planning frame."""
        return self._replace_fields(fixed_frames={**self.fixed_frames, **frames}) if frames else self

    def with_padding(self, padding: Padding) -> PlanningScene:
        """Returns the scene with a new padding; raises UnknownNameError for an unknown link."""
        for link in (*padding.links, *padding.scales):
            if not self.model.has_link(link):
                raise UnknownNameError(
                    ErrorCode.INVALID_LINK_NAME, "link padding and scale: link", link, self.model.frame_ids
                )
        return self._replace_fields(padding=padding)

    def with_octomap(self, octree: Octree | None, pose: Transform = None) -> PlanningScene:
        """Returns the scene with a new octomap.

        Args:
            octree: Octomap; None clears the octomap.
            pose: Pose of the octomap's origin in the planning frame; None for identity.
        """
        if octree is None:
            return self._replace_fields(octomap=None)
        from pinocchio import SE3

        body = CollisionObject(OCTOMAP_ID, SE3.Identity() if pose is None else pose, ((octree, SE3.Identity()),))
        return self._replace_fields(octomap=body)

    def obstacles(self) -> tuple[CollisionObject, ...]:
        """Returns all world objects, and the octomap if a voxel is occupied."""
        if self.octomap is None or not len(self.octomap.shapes[0][0].centers):  # type: ignore[attr-defined]
            return tuple(self.objects.values())
        return (*self.objects.values(), self.octomap)

    def link_margins(self) -> Array:
        """Returns the margin between each of the model's link geometries and the world, shape (n,) [m]."""
        links, padding = self.model.link_geometries, self.padding
        if not padding.links and not padding.scales:
            return np.full(len(links), padding.objects)
        return np.array([padding.margin(item.link, item.geometry) for item in links])

    def attached_padding(self) -> float:
        """Returns the margin between held objects and the world [m]."""
        return self.padding.attached + self.padding.objects

    def with_object(self, body: CollisionObject) -> PlanningScene:
        """Adds an object; an existing world or attached object with the same name is replaced.

        Raises:
            GeometryError: The object has no shape or no name, or a link has the same name.
        """
        if not body.name:
            raise GeometryError("collision object: id is empty; give the object a name")
        if not body.shapes:
            raise GeometryError(f"collision object '{body.name}': no shape; add at least one shape")
        if self.model.has_link(body.name):
            raise GeometryError(f"collision object '{body.name}': a link of the robot has this name; use another id")
        return self._replace_fields(
            objects={**self.objects, body.name: body},
            attached={key: value for key, value in self.attached.items() if key != body.name},
        )

    def with_shapes_appended(self, body: CollisionObject) -> PlanningScene:
        """Adds shapes to an object, which keeps its pose; an unknown object is added."""
        old = self.objects.get(body.name)
        if old is None:
            return self.with_object(body)
        new_in_old = old.pose.inverse() * body.pose
        added = [(shape, new_in_old * pose) for shape, pose in body.shapes]
        shapes = tuple(sorted((*old.shapes, *added), key=lambda item: _message_order(item[0])))
        subframes = {**old.subframes, **{name: new_in_old * pose for name, pose in body.subframes.items()}}
        return self._replace_fields(
            objects={**self.objects, body.name: replace(old, shapes=shapes, subframes=subframes)}
        )

    def with_object_moved(self, name: str, pose: Transform, shape_poses: Sequence[Transform] = ()) -> PlanningScene:
        """Moves an object.

        Args:
            name: Name of the object.
            pose: New pose in the planning frame.
            shape_poses: New poses of all shapes in the object's frame; empty to leave the shapes in place.

        Raises:
            UnknownNameError: The object does not exist.
            GeometryError: The number of shape poses differs from the number of shapes.
        """
        body = self.find_object(name)
        shapes = body.shapes
        if shape_poses:
            if len(shape_poses) != len(shapes):
                raise GeometryError(
                    f"moving '{name}': got {len(shape_poses)} shape poses for {len(shapes)} shapes; "
                    "give one pose per shape, or none to move the whole object"
                )
            shapes = tuple((shape, shape_pose) for (shape, _), shape_pose in zip(shapes, shape_poses, strict=True))
        return self._replace_fields(objects={**self.objects, name: replace(body, pose=pose, shapes=shapes)})

    def without_object(self, name: str) -> PlanningScene:
        """Removes an object and its colour from the world; raises UnknownNameError."""
        self.find_object(name)
        return self._without_entries(objects={name})

    def without_objects(self) -> PlanningScene:
        """Removes every object and its colour from the world; attached objects stay."""
        return self._without_entries(objects=self.objects.keys())

    def _without_entries(self, **names: Set[str]) -> PlanningScene:
        """Returns the scene without the named `objects` or `attached` objects and their colours."""
        changes: dict[str, object] = {}
        for kind, removed in names.items():
            changes[kind] = {key: value for key, value in getattr(self, kind).items() if key not in removed}
            if self.colors.keys() & removed:
                changes["colors"] = {key: value for key, value in self.colors.items() if key not in removed}
        return self._replace_fields(**changes)

    def find_object(self, name: str) -> CollisionObject:
        """Returns an object of the world; raises UnknownNameError."""
        if name not in self.objects:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, "collision object", name, self.objects)
        return self.objects[name]

    def with_attached(self, item: AttachedObject) -> PlanningScene:
        """Attaches a body to a link and removes the world object of the same name.

        Raises:
            UnknownNameError: The link or a touch link does not exist.
            GeometryError: The body has no shape.
        """
        for link in (item.link, *sorted(item.touch_links)):
            if not self.model.has_link(link):
                raise UnknownNameError(
                    ErrorCode.INVALID_LINK_NAME, f"attaching '{item.name}': link", link, self.model.frame_ids
                )
        if not item.body.shapes:
            raise GeometryError(
                f"attached object '{item.name}': no shape, and no world object has this name; add a shape"
            )
        return self._replace_fields(
            attached={**self.attached, item.name: item},
            objects={key: value for key, value in self.objects.items() if key != item.name},
        )

    def with_detached(self, name: str) -> PlanningScene:
        """Moves an attached body back into the world at its current pose; raises UnknownNameError."""
        if name not in self.attached:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, "attached object", name, self.attached)
        body = replace(self.attached[name].body, pose=self.attached_pose(name))
        rest = {key: value for key, value in self.attached.items() if key != name}
        return self._replace_fields(attached=rest, objects={**self.objects, name: body})

    def without_attached(self, names: Iterable[str]) -> PlanningScene:
        """Deletes attached bodies and their colours."""
        return self._without_entries(attached=set(names))

    def attached_pose(self, name: str) -> Transform:
        """Returns the pose of an attached body in the planning frame at the scene's joint positions."""
        item = self.attached[name]
        return self.model.link_transforms(self.positions)[item.link] * item.body.pose

    def frame_transform(self, frame: str, positions: Array | None = None) -> Transform:
        """Returns the pose of a frame in the planning frame.

        Args:
            frame: A link, an object, "object/subframe" or a fixed frame (from tf); empty for the planning frame.
            positions: Joint positions [rad or m]; None for the scene's positions.

        Raises:
            UnknownNameError: The frame does not exist.
        """
        from pinocchio import SE3

        frame = frame.removeprefix("/")
        if frame in ("", self.model.planning_frame):
            return SE3.Identity()
        if self.model.has_link(frame):
            return self.model.link_transforms(self.positions if positions is None else positions)[frame]
        transform = self._body_transform(frame, positions)
        if transform is None:
            transform = self._subframe_transform(frame, positions)
        if transform is None:
            transform = self.fixed_frames.get(
                frame
            )  # last, because object detectors may publish tf frames named like objects
        if transform is None:
            known = [*self.model.frame_ids, *self._body_frames(), *self.fixed_frames]
            raise UnknownNameError(ErrorCode.FRAME_TRANSFORM_FAILURE, "frame", frame, known)
        return transform

    def _bodies(self) -> dict[str, CollisionObject]:
        return {**self.objects, **{name: item.body for name, item in self.attached.items()}}

    def _body_frames(self) -> list[str]:
        bodies = self._bodies()
        return [*bodies, *(f"{name}/{inner}" for name, body in bodies.items() for inner in body.subframes)]

    def _subframe_transform(self, frame: str, positions: Array | None) -> Transform | None:
        for name, body in self._bodies().items():  # names of objects and of subframes may contain slashes
            inner = frame.removeprefix(f"{name}/")
            if inner != frame and inner in body.subframes:
                return self._body_transform(name, positions) * body.subframes[inner]
        return None

    def _body_transform(self, name: str, positions: Array | None) -> Transform | None:
        if name in self.objects:
            return self.objects[name].pose
        if name in self.attached:
            item = self.attached[name]
            state = self.positions if positions is None else positions
            return self.model.link_transforms(state)[item.link] * item.body.pose
        return None


SceneChange = Callable[[PlanningScene], PlanningScene]


def _message_order(shape: Shape) -> int:
    """Returns the sort key of a shape: messages list primitives first, then meshes, then planes."""
    return 2 if isinstance(shape, Plane) else 1 if isinstance(shape, Mesh) else 0


def empty_scene(model: RobotModel, positions: Array | None = None) -> PlanningScene:
    """Returns the scene of a robot in an empty world, with the SRDF's allowed collisions."""
    start = model.default_positions() if positions is None else model.with_mimics(positions)
    return PlanningScene(model=model, positions=start, acm=_matrix_of_srdf(model))


@lru_cache(maxsize=MAX_CACHED_MODELS)
def _matrix_of_srdf(model: RobotModel) -> AllowedCollisionMatrix:
    return matrix_from_semantics(model.semantics, model.document.links)
