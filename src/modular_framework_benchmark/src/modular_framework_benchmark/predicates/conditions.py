# SPDX-License-Identifier: BSD-3-Clause
"""Conditions on the objects of an episode.

Frames are as in the simulation: the world frame has z up; the frame of a model is the frame in its SDF file. The box of
an object is the bounding box of its collision shapes in the model frame. "At the start" is the start of the task.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.predicates.predicate import Condition
from modular_framework_benchmark.predicates.predicate_keys import KeyKind, name, number, vector, whole_number
from modular_framework_benchmark.predicates.world_track import ROBOT, WORLD, BodyTrack, Flags, Floats, WorldTrack
from modular_framework_benchmark.records.episode_settings import Tagged
from modular_framework_ros.allowed_names import listing, nearest

ON_TOP_OF, OLD_ON_TOP_OF = "on_top_of", "on"
"""Name of a predicate, and its old name, which PyYAML reads and writes as true."""
Span = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """A box in the world frame.

    Attributes:
        name: Name of the region.
        x: Smallest and largest x [m].
        y: Smallest and largest y [m].
        z: Smallest and largest z [m]; None for any height.
    """

    name: str
    x: Span
    y: Span
    z: Span | None = None

    def contains(self, points: Floats) -> Flags:
        """Returns whether points are in the region, shape (n,).

        Args:
            points: Points in the world frame, shape (n, 3) [m].
        """
        inside = [(points[:, axis] >= low) & (points[:, axis] <= high) for axis, (low, high) in self._spans]
        return np.logical_and.reduce(inside)

    def is_apart_from(self, other: Region) -> bool:
        """Returns whether the region has no point in common with another region."""
        spans = dict(other._spans)
        return any(
            axis in spans and (high < spans[axis][0] or spans[axis][1] < low) for axis, (low, high) in self._spans
        )

    @property
    def as_parameter(self) -> dict[str, list[float]]:
        """Returns the region as an entry of the ROS parameter /regions, {axis: [LOW, HIGH]} [m]."""
        return {"xyz"[axis]: list(span) for axis, span in self._spans}

    @property
    def _spans(self) -> list[tuple[int, Span]]:
        return [(axis, span) for axis, span in enumerate((self.x, self.y, self.z)) if span is not None]


REGIONS = "/regions"
"""ROS parameter with the regions of the task, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectCondition(Condition):
    """A condition on one object.

    Attributes:
        object: Name of the object.
    """

    object: str = name(KeyKind.OBJECT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifted(ObjectCondition):
    """The frame of the object is higher in the world frame than at the start of the task.

    Attributes:
        height: Height above the start that must be exceeded [m].
    """

    height: float = number(0.1, high=10.0)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is more than {self.height:g} m higher than at the start"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the object is higher than wanted, shape (n,)."""
        return self._heights(world) > self.height

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the height above the start."""
        return f"'{self.object}' is {self._heights(world)[-1]:.3f} m higher (wanted: more than {self.height:g} m)"

    def _heights(self, world: WorldTrack) -> Floats:
        heights = world.bodies[self.object].positions[:, 2]
        return np.asarray(heights - heights[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldFor(ObjectCondition):
    """A gripper holds the object: the object touches two fingers, with interruptions of less than 0.3 s."""

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is in the gripper"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether a gripper holds the object, shape (n,)."""
        return world.holds(self.object)

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns whether a gripper holds the object."""
        return f"'{self.object}' is {'' if world.holds(self.object)[-1] else 'not '}in the gripper"


@dataclass(frozen=True, slots=True, kw_only=True)
class InRegion(ObjectCondition):
    """The centre of the object's box is in a region of the world frame.

    Attributes:
        region: The region.
    """

    region: Region = name(KeyKind.REGION)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is in the region '{self.region.name}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the centre is in the region, shape (n,)."""
        return self.region.contains(world.bodies[self.object].centres)

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the position of the centre."""
        x, y, z = world.bodies[self.object].centres[-1]
        return f"'{self.object}' is at ({x:.3f}, {y:.3f}, {z:.3f}) m (wanted: in the region '{self.region.name}')"


@dataclass(frozen=True, slots=True, kw_only=True)
class OnTopOf(ObjectCondition):
    """The object lies on a support.

    The object touches the support, the lowest point of the object's box is at the height of the highest point of the
    support's box, and the centre of the object's box is above the support's box.

    Attributes:
        support: Name of the model below the object.
        tolerance: Largest difference between the two heights [m].
    """

    support: str = name(KeyKind.MODEL)
    tolerance: float = number(0.01, high=1.0)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' lies on '{self.support}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the object lies on the support, shape (n,)."""
        touching, level = world.touches(self.object, self.support), np.abs(self._gaps(world)) <= self.tolerance
        return touching & level & _is_above(world.bodies[self.object].centres, world.bodies[self.support])

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the contact and the gap between object and support."""
        touch = "touches" if world.touches(self.object, self.support)[-1] else "does not touch"
        gap = f"its bottom is {self._gaps(world)[-1]:.3f} m above the top of '{self.support}'"
        return f"'{self.object}' {touch} '{self.support}', and {gap} (wanted: on '{self.support}')"

    def _gaps(self, world: WorldTrack) -> Floats:
        bottom = world.bodies[self.object].corners[:, :, 2].min(axis=1)
        return np.asarray(bottom - world.bodies[self.support].corners[:, :, 2].max(axis=1))


def _is_above(points: Floats, body: BodyTrack) -> Flags:
    """Returns whether points are above or below the box of a body, shape (n,).

    The projection of the box on the ground is a polygon with the projected edges of the box as sides. A point is inside
    if it is within the polygon's width along the normal of each side.

    Args:
        points: Points in the world frame, shape (n, 3) [m].
        body: States of the body.
    """
    edges = body.rotations.as_matrix()[:, :2, :] * (body.box[1] - body.box[0]) / 2.0
    offsets = (points - body.centres)[:, :2]
    inside = np.ones(len(points), dtype=bool)
    for axis in range(3):
        normals = np.column_stack([-edges[:, 1, axis], edges[:, 0, axis]])
        widths = np.abs(np.einsum("ni,nij->nj", normals, edges)).sum(axis=1)
        inside &= np.abs(np.einsum("ni,ni->n", normals, offsets)) <= widths
    return inside


@dataclass(frozen=True, slots=True, kw_only=True)
class Inside(ObjectCondition):
    """All corners of the object's box are inside the box of a container, in the frame of the container.

    Attributes:
        container: Name of the model around the object.
        tolerance: Distance by which corners may leave the container's box [m].
    """

    container: str = name(KeyKind.MODEL)
    tolerance: float = number(0.005, high=1.0)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is inside '{self.container}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether all corners are inside, shape (n,)."""
        return self._excess(world) <= self.tolerance

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the distance by which corners leave the container's box."""
        excess = f"leaves the box of '{self.container}' by {max(self._excess(world)[-1], 0.0):.3f} m"
        return f"'{self.object}' {excess} (wanted: at most {self.tolerance:g} m)"

    def _excess(self, world: WorldTrack) -> Floats:
        container = world.bodies[self.container]
        points, (low, high) = container.points_in_frame(world.bodies[self.object].corners), container.box
        return np.asarray(np.maximum(low - points, points - high).max(axis=(1, 2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Upright(ObjectCondition):
    """The z axis of the object points up in the world frame.

    Attributes:
        angle: Largest angle between the axis and the vertical [rad].
    """

    angle: float = number(0.1, high=3.1416)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' stands upright"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the axis points up, shape (n,)."""
        return self._angles(world) <= self.angle

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the angle to the vertical."""
        return f"'{self.object}' is tilted by {self._angles(world)[-1]:.3f} rad (wanted: at most {self.angle:g} rad)"

    def _angles(self, world: WorldTrack) -> Floats:
        body = world.bodies[self.object]
        cosines = np.where(np.isnan(body.positions[:, 0]), np.nan, body.rotations.as_matrix()[:, 2, 2])
        return np.arccos(np.clip(cosines, -1.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCondition(ObjectCondition):
    """The frame of the object is near a pose.

    Attributes:
        distance: Largest distance from the pose [m].
        angle: Largest rotation angle from the pose [rad]; pi allows every orientation.
    """

    distance: float = number(0.01, high=10.0)
    angle: float = number(0.1, high=3.1416)

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the object is within both tolerances, shape (n,)."""
        distances, angles = self._errors(world)
        return (distances <= self.distance) & (angles <= self.angle)

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the distance and the angle from the pose."""
        distances, angles = self._errors(world)
        wanted_text = f"wanted: at most {self.distance:g} m and {self.angle:g} rad"
        return f"{self._deviation_text(f'{distances[-1]:.3f} m', f'{angles[-1]:.3f} rad')} ({wanted_text})"

    @abstractmethod
    def _errors(self, world: WorldTrack) -> tuple[Floats, Floats]:
        """Returns the distances [m] and the angles [rad] from the pose, each of shape (n,)."""

    @abstractmethod
    def _deviation_text(self, distance: str, angle: str) -> str:
        """Returns a description of the measured distance and angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned(PoseCondition):
    """The frame of the object is at a pose in the world frame or in the frame of another model.

    Attributes:
        relative_to: Name of the model in whose frame the pose is given, or `world`.
        position: Wanted position of the object [m].
        rpy: Wanted roll, pitch and yaw of the object [rad].
    """

    relative_to: str = name(KeyKind.MODEL, WORLD, default=WORLD)
    position: tuple[float, float, float] = vector(low=-100.0, high=100.0)
    rpy: tuple[float, float, float] = vector(low=-6.2832, high=6.2832)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is at {self.position} m, {self.rpy} rad of '{self.relative_to}'"

    def _deviation_text(self, distance: str, angle: str) -> str:
        return f"'{self.object}' is {distance} and {angle} from its pose"

    def _errors(self, world: WorldTrack) -> tuple[Floats, Floats]:
        body, positions, rotations = (
            world.bodies[self.object],
            np.array(self.position),
            Rotation.from_euler("xyz", self.rpy),
        )
        if self.relative_to != WORLD:
            frame = world.bodies[self.relative_to]
            positions = frame.positions + frame.rotations.apply(positions)
            rotations = frame.rotations * rotations
        distances = np.linalg.norm(body.positions - positions, axis=1)
        return distances, (rotations.inv() * body.rotations).magnitude()


@dataclass(frozen=True, slots=True, kw_only=True)
class JointAtLeast(Condition):
    """A joint of an articulated model, such as a drawer, is at a position or beyond.

    Attributes:
        model: Name of the model.
        joint: Name of the joint.
        position: Smallest position [rad or m].
    """

    model: str = name(KeyKind.MODEL)
    joint: str = name(KeyKind.JOINT)
    position: float = number(None, low=-1000.0, required=True)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"joint '{self.joint}' of '{self.model}' is at {self.position:g} or beyond"

    def unknown_name_text(self, world: WorldTrack) -> str:
        """Returns a text if the model or its joint never existed in the world, otherwise ""."""
        text, joints = Condition.unknown_name_text(self, world), []
        if not text:
            joints = list(world.bodies[self.model].joints)
        if text or self.joint in joints:
            return text
        return f"'{self.model}' has no joint '{self.joint}'; {listing(joints)}{nearest(self.joint, joints)}"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the joint is at the position or beyond, shape (n,); never for an unknown joint."""
        positions = world.bodies[self.model].joints.get(self.joint)
        return np.zeros(len(world.times_s), dtype=bool) if positions is None else positions >= self.position

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the position of the joint, or the joints of the model."""
        if text := self.unknown_name_text(world):
            return text
        found = f"joint '{self.joint}' of '{self.model}' is at {world.bodies[self.model].joints[self.joint][-1]:.3f}"
        return f"{found} (wanted: at least {self.position:g})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cleared(Condition):
    """The centres of the boxes of all objects are outside a region of the world frame.

    Attributes:
        region: The region.
        objects: Names of the objects.
    """

    region: Region = name(KeyKind.REGION)
    objects: tuple[str, ...] = name(KeyKind.OBJECTS)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"none of {', '.join(self.objects)} is in the region '{self.region.name}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether all objects are outside, shape (n,)."""
        return ~np.logical_or.reduce([self.region.contains(world.bodies[each].centres) for each in self.objects])

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the objects in the region."""
        objects_inside = [each for each in self.objects if self.region.contains(world.bodies[each].centres)[-1]]
        return f"{', '.join(objects_inside) or 'nothing'} is in the region '{self.region.name}' (wanted: nothing)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Collected(Condition):
    """The centres of the boxes of enough objects are in a region of the world frame; held objects do not count.

    Attributes:
        region: The region.
        objects: Names of the objects.
        count: Smallest number of objects in the region; None for all.
    """

    region: Region = name(KeyKind.REGION)
    objects: tuple[str, ...] = name(KeyKind.OBJECTS)
    count: int | None = whole_number(1)

    @property
    def wanted(self) -> int:
        """Returns the smallest number of objects in the region."""
        return len(self.objects) if self.count is None else self.count

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"at least {self.wanted} of {', '.join(self.objects)} are in the region '{self.region.name}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether enough objects are in the region, shape (n,)."""
        return np.asarray(self.collected_objects(world).sum(axis=0) >= self.wanted)

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the number of objects in the region, and the objects that are elsewhere."""
        inside = self.collected_objects(world)[:, -1]
        elsewhere = [each for each, is_inside in zip(self.objects, inside, strict=True) if not is_inside]
        found = f"{inside.sum()} of {len(self.objects)} objects are in the region '{self.region.name}'"
        return f"{found} (wanted: at least {self.wanted}; elsewhere: {', '.join(elsewhere) or 'none'})"

    def collected_objects(self, world: WorldTrack) -> Flags:
        """Returns whether each object is in the region and released at each moment, shape (objects, n)."""
        return np.array(
            [self.region.contains(world.bodies[each].centres) & ~world.holds(each) for each in self.objects]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class NotMoved(PoseCondition):
    """The frame of the object is at its pose at the start of the task."""

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' is where it was at the start"

    def _deviation_text(self, distance: str, angle: str) -> str:
        return f"'{self.object}' has moved by {distance} and {angle}"

    def _errors(self, world: WorldTrack) -> tuple[Floats, Floats]:
        body = world.bodies[self.object]
        distances = np.linalg.norm(body.positions - body.positions[0], axis=1)
        return distances, (body.rotations[0].inv() * body.rotations).magnitude()


@dataclass(frozen=True, slots=True, kw_only=True)
class NoContact(ObjectCondition):
    """The object does not press on another model.

    Attributes:
        other: Name of the other model, or `robot` for any robot.
    """

    other: str = name(KeyKind.MODEL, ROBOT, default=ROBOT)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' does not touch '{self.other}'"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the models do not touch, shape (n,)."""
        exists = ~np.isnan(world.bodies[self.object].positions[:, 0])
        return exists & ~world.touches(self.object, self.other)

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns whether the models touch."""
        touch = "touches" if world.touches(self.object, self.other)[-1] else "does not touch"
        return f"'{self.object}' {touch} '{self.other}' (wanted: no contact)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Untouched(NoContact):
    """The object has not pressed on another model since the start of the task."""

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"'{self.object}' has not touched '{self.other}' since the start"

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the models have not touched up to each moment, shape (n,)."""
        exists = ~np.isnan(world.bodies[self.object].positions[:, 0])
        return np.asarray(exists & ~np.logical_or.accumulate(world.touches(self.object, self.other)))

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the moment of the first contact."""
        touching = world.touches(self.object, self.other)
        if not touching.any():
            return f"'{self.object}' has not touched '{self.other}' (wanted: no contact)"
        after_s = float(world.times_s[np.argmax(touching)] - world.times_s[0])
        return f"'{self.object}' touched '{self.other}' {after_s:.2f} s after the start (wanted: no contact)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Stacked(Condition):
    """Each object lies on the previous object, as in `On`.

    Attributes:
        objects: Names of at least two objects, the lowest first.
        tolerance: Largest difference between the heights of two touching faces [m].
    """

    objects: tuple[str, ...] = name(KeyKind.OBJECTS)
    tolerance: float = number(0.01, high=1.0)

    @property
    def statement(self) -> str:
        """Returns a description of the condition."""
        return f"{', '.join(self.objects)} are stacked, the lowest first"

    @property
    def pairs(self) -> tuple[OnTopOf, ...]:
        """Returns the conditions on neighbouring objects, from the bottom."""
        neighbours = zip(self.objects, self.objects[1:], strict=False)
        return tuple(OnTopOf(object=upper, support=lower, tolerance=self.tolerance) for lower, upper in neighbours)

    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether all pairs lie on each other, shape (n,)."""
        return np.logical_and.reduce([pair.satisfied_in(world) for pair in self.pairs])

    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the lowest pair that does not lie on each other."""
        wrong = [pair for pair in self.pairs if not pair.satisfied_in(world)[-1]]
        return wrong[0].measurement_text(world) if wrong else self.statement


CONDITIONS: dict[str, type[Condition]] = {
    "lifted": Lifted,
    "held_for": HeldFor,
    "in_region": InRegion,
    ON_TOP_OF: OnTopOf,
    "inside": Inside,
    "upright": Upright,
    "aligned": Aligned,
    "joint_at_least": JointAtLeast,
    "cleared": Cleared,
    "collected": Collected,
    "not_moved": NotMoved,
    "no_contact": NoContact,
    "untouched": Untouched,
    "stacked": Stacked,
}
"""All conditions, keyed by their name in experiment files."""
Tagged.kinds[OLD_ON_TOP_OF] = OnTopOf  # in records of older versions
