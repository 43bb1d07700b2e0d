# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene as immutable snapshots, so that a plan in progress never sees a partial change."""

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
        pose: frame of the object in the planning frame (for an attached one: in the link's frame).
        shapes: each shape with its pose in the object's frame.
        subframes: named poses in the object's frame.
    """

    name: str
    pose: Transform
    shapes: tuple[tuple[Shape, Transform], ...]
    subframes: Mapping[str, Transform] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class AttachedObject:
    """A body that moves with a link; it may touch that link and the links named in `touch_links`."""

    body: CollisionObject
    link: str
    touch_links: frozenset[str]

    @property
    def name(self) -> str:
        """The id of the attached body."""
        return self.body.name


@dataclass(frozen=True, slots=True, eq=False)
class PlanningScene:
    """One version of the world: objects, attached objects, allowed collisions and the robot's positions.

    Every `with_...` method returns a new snapshot with a new version number; the old one stays as it is.
    `geometry_version` is new whenever a collision check of a state may have another result.
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

    def _changed(self, **changes: object) -> PlanningScene:
        number = next(_versions)
        geometry = self.geometry_version
        if changes.keys() & {"objects", "attached", "acm", "padding", "octomap"}:
            geometry = number
        return replace(self, version=number, geometry_version=geometry, **changes)  # type: ignore[arg-type]

    def with_positions(self, positions: Array) -> PlanningScene:
        """Returns the scene with the robot at other joint positions."""
        return self._changed(positions=positions)

    def with_acm(self, acm: AllowedCollisionMatrix) -> PlanningScene:
        """Returns the scene with another allowed collision matrix."""
        return self._changed(acm=acm)

    def with_name(self, name: str) -> PlanningScene:
        """Returns the scene under another name."""
        return self._changed(name=name)

    def with_colors(self, colors: Mapping[str, Color]) -> PlanningScene:
        """Returns the scene with colours (r, g, b, a in 0..1) added to those it has."""
        return self._changed(colors={**self.colors, **colors})

    def with_fixed_frames(self, frames: Mapping[str, Transform]) -> PlanningScene:
        """Returns the scene with further named frames, given in the planning frame."""
        return self._changed(fixed_frames={**self.fixed_frames, **frames}) if frames else self

    def with_padding(self, padding: Padding) -> PlanningScene:
        """Returns the scene with another padding; raises UnknownNameError for a link the robot does not have."""
        for link in (*padding.links, *padding.scales):
            if not self.model.has_link(link):
                raise UnknownNameError(
                    ErrorCode.INVALID_LINK_NAME, "link padding and scale: link", link, self.model.frame_ids
                )
        return self._changed(padding=padding)

    def with_octomap(self, octree: Octree | None, pose: Transform = None) -> PlanningScene:
        """Returns the scene with another octomap, its origin at a pose in the planning frame; None clears it."""
        if octree is None:
            return self._changed(octomap=None)
        from pinocchio import SE3

        body = CollisionObject(OCTOMAP_ID, SE3.Identity() if pose is None else pose, ((octree, SE3.Identity()),))
        return self._changed(octomap=body)

    def obstacles(self) -> tuple[CollisionObject, ...]:
        """Returns the obstacles of the world: every object, and the octomap if it has an occupied voxel."""
        if self.octomap is None or not len(self.octomap.shapes[0][0].centers):  # type: ignore[attr-defined]
            return tuple(self.objects.values())
        return (*self.objects.values(), self.octomap)

    def link_margins(self) -> Array:
        """Returns the distance [m] each of the model's link geometries keeps from the world; (n,), in their order."""
        links, padding = self.model.link_geometries, self.padding
        if not padding.links and not padding.scales:
            return np.full(len(links), padding.objects)
        return np.array([padding.margin(item.link, item.geometry) for item in links])

    def attached_padding(self) -> float:
        """Returns the distance [m] held objects keep from the world."""
        return self.padding.attached + self.padding.objects

    def with_object(self, body: CollisionObject) -> PlanningScene:
        """Adds an object, or replaces the one of that name.

        Raises:
            GeometryError: it has no shape or no name, or a link or an attached object has that name.
        """
        if not body.name:
            raise GeometryError("collision object: id is empty; give the object a name")
        if not body.shapes:
            raise GeometryError(f"collision object '{body.name}': no shape; an object to ADD needs at least one")
        if self.model.has_link(body.name):
            raise GeometryError(f"collision object '{body.name}': a link of the robot has that name; use another id")
        return self._changed(
            objects={**self.objects, body.name: body},
            attached={key: value for key, value in self.attached.items() if key != body.name},
        )

    def with_shapes_appended(self, body: CollisionObject) -> PlanningScene:
        """Adds shapes to an object (an unknown object is added); the object keeps its own pose."""
        old = self.objects.get(body.name)
        if old is None:
            return self.with_object(body)
        into_old = old.pose.inverse() * body.pose
        added = [(shape, into_old * pose) for shape, pose in body.shapes]
        shapes = tuple(sorted((*old.shapes, *added), key=lambda item: _place_in_message(item[0])))
        subframes = {**old.subframes, **{name: into_old * pose for name, pose in body.subframes.items()}}
        return self._changed(objects={**self.objects, body.name: replace(old, shapes=shapes, subframes=subframes)})

    def with_object_moved(self, name: str, pose: Transform, shape_poses: Sequence[Transform] = ()) -> PlanningScene:
        """Moves an object to another pose in the planning frame and, if given, its shapes to other poses in the object.

        Raises:
            UnknownNameError: no such object.
            GeometryError: there are poses of shapes, but not one for each shape.
        """
        body = self.find_object(name)
        shapes = body.shapes
        if shape_poses:
            if len(shape_poses) != len(shapes):
                raise GeometryError(
                    f"moving '{name}': {len(shape_poses)} poses of shapes for {len(shapes)} shapes; "
                    "give one for each shape, or none to move the object as a whole"
                )
            shapes = tuple((shape, shape_pose) for (shape, _), shape_pose in zip(shapes, shape_poses, strict=True))
        return self._changed(objects={**self.objects, name: replace(body, pose=pose, shapes=shapes)})

    def without_object(self, name: str) -> PlanningScene:
        """Removes an object and its colour from the world; raises UnknownNameError."""
        self.find_object(name)
        return self._without(objects={name})

    def without_objects(self) -> PlanningScene:
        """Removes every object and its colour from the world; attached ones stay."""
        return self._without(objects=self.objects.keys())

    def _without(self, **names: Set[str]) -> PlanningScene:
        """Returns the scene without some of its `objects` or `attached`, and without their colours."""
        changes: dict[str, object] = {}
        for kind, drop in names.items():
            changes[kind] = {key: value for key, value in getattr(self, kind).items() if key not in drop}
            if self.colors.keys() & drop:
                changes["colors"] = {key: value for key, value in self.colors.items() if key not in drop}
        return self._changed(**changes)

    def find_object(self, name: str) -> CollisionObject:
        """Returns an object of the world; raises UnknownNameError with the known ones."""
        if name not in self.objects:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, "collision object", name, self.objects)
        return self.objects[name]

    def with_attached(self, item: AttachedObject) -> PlanningScene:
        """Attaches a body to a link; a world object of that name disappears from the world.

        Raises:
            UnknownNameError: the link, or a touch link, does not exist.
            GeometryError: the body has no shape.
        """
        for link in (item.link, *sorted(item.touch_links)):
            if not self.model.has_link(link):
                raise UnknownNameError(
                    ErrorCode.INVALID_LINK_NAME, f"attaching '{item.name}': link", link, self.model.frame_ids
                )
        if not item.body.shapes:
            raise GeometryError(f"attached object '{item.name}': no shape, and the world has no object of that name")
        return self._changed(
            attached={**self.attached, item.name: item},
            objects={key: value for key, value in self.objects.items() if key != item.name},
        )

    def with_detached(self, name: str) -> PlanningScene:
        """Puts an attached body back into the world at its present pose; raises UnknownNameError."""
        if name not in self.attached:
            raise UnknownNameError(ErrorCode.INVALID_OBJECT_NAME, "attached object", name, self.attached)
        body = replace(self.attached[name].body, pose=self.attached_pose(name))
        rest = {key: value for key, value in self.attached.items() if key != name}
        return self._changed(attached=rest, objects={**self.objects, name: body})

    def without_attached(self, names: Iterable[str]) -> PlanningScene:
        """Drops attached bodies and their colours without putting them into the world."""
        return self._without(attached=set(names))

    def attached_pose(self, name: str) -> Transform:
        """Returns the pose of an attached body in the planning frame at the scene's positions."""
        item = self.attached[name]
        return self.model.link_transforms(self.positions)[item.link] * item.body.pose

    def frame_transform(self, frame: str, positions: Array | None = None) -> Transform:
        """Returns the pose of a frame in the planning frame.

        Args:
            frame: a link, an object, "object/subframe", a fixed frame (as of tf); empty means the planning frame.
            positions: joint positions [rad or m] to use instead of the scene's.

        Raises:
            UnknownNameError: no such frame.
        """
        from pinocchio import SE3

        frame = frame.removeprefix("/")
        if frame in ("", self.model.planning_frame):
            return SE3.Identity()
        if self.model.has_link(frame):
            return self.model.link_transforms(self.positions if positions is None else positions)[frame]
        found = self._body_transform(frame, positions)
        if found is None:
            found = self._subframe_transform(frame, positions)
        if found is None:
            found = self.fixed_frames.get(frame)  # last: what finds objects may call a frame of tf as the object
        if found is None:
            known = [*self.model.frame_ids, *self._body_frames(), *self.fixed_frames]
            raise UnknownNameError(ErrorCode.FRAME_TRANSFORM_FAILURE, "frame", frame, known)
        return found

    def _bodies(self) -> dict[str, CollisionObject]:
        return {**self.objects, **{name: item.body for name, item in self.attached.items()}}

    def _body_frames(self) -> list[str]:
        bodies = self._bodies()
        return [*bodies, *(f"{name}/{inner}" for name, body in bodies.items() for inner in body.subframes)]

    def _subframe_transform(self, frame: str, positions: Array | None) -> Transform | None:
        for name, body in self._bodies().items():  # names of objects and of subframes may hold a slash themselves
            inner = frame.removeprefix(f"{name}/")
            if inner != frame and inner in body.subframes:
                return self._body_transform(name, positions) * body.subframes[inner]
        return None

    def _body_transform(self, name: str, positions: Array | None) -> Transform | None:
        if name in self.objects:
            return self.objects[name].pose
        if name in self.attached:
            item = self.attached[name]
            at = self.positions if positions is None else positions
            return self.model.link_transforms(at)[item.link] * item.body.pose
        return None


SceneChange = Callable[[PlanningScene], PlanningScene]


def _place_in_message(shape: Shape) -> int:
    """Messages list primitives, then meshes, then planes; poses of shapes are given in that order."""
    return 2 if isinstance(shape, Plane) else 1 if isinstance(shape, Mesh) else 0


def empty_scene(model: RobotModel, positions: Array | None = None) -> PlanningScene:
    """Returns the scene of a robot alone in the world, with the SRDF's allowed collisions."""
    start = model.default_positions() if positions is None else model.with_mimics(positions)
    return PlanningScene(model=model, positions=start, acm=_matrix_of_srdf(model))


@lru_cache(maxsize=MAX_CACHED_MODELS)
def _matrix_of_srdf(model: RobotModel) -> AllowedCollisionMatrix:
    return matrix_from_semantics(model.semantics, model.document.links)
