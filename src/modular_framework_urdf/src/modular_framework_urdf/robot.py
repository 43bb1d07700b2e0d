# SPDX-License-Identifier: BSD-3-Clause
"""Content of a URDF as plain records, created by `urdf_reader.read_urdf`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.rotations import matrix_from_rpy

Vector = tuple[float, float, float]
MOVABLE_KINDS = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, slots=True)
class Origin:
    """A pose in the parent frame.

    Attributes:
        xyz: Position [m].
        rpy: Rotations about the fixed axes x, y and z, in this order [rad].
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    def matrix(self) -> npt.NDArray[np.float64]:
        """Returns the pose as a (4, 4) matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = matrix_from_rpy(*self.rpy)
        matrix[:3, 3] = self.xyz
        return matrix


@dataclass(frozen=True, slots=True)
class Box:
    """A box.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    tag: ClassVar[str] = "box"
    size: Vector


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere.

    Attributes:
        radius: Radius [m].
    """

    tag: ClassVar[str] = "sphere"
    radius: float


@dataclass(frozen=True, slots=True)
class _RoundShape:
    """A round shape along the z axis, with radius and length [m]."""

    radius: float
    length: float


class Cylinder(_RoundShape):
    """A cylinder."""

    tag: ClassVar[str] = "cylinder"


class Capsule(_RoundShape):
    """A cylinder with hemispheres on both ends; the length excludes the hemispheres."""

    tag: ClassVar[str] = "capsule"


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh file.

    Attributes:
        uri: URI of the file.
        scale: Scale factors along x, y and z.
    """

    tag: ClassVar[str] = "mesh"
    uri: str
    scale: Vector


@dataclass(frozen=True, slots=True)
class UnknownShape:
    """A shape that is not part of URDF."""

    tag: str


Shape = Box | Sphere | Cylinder | Capsule | MeshFile | UnknownShape


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfElement:
    """Base class of records with a line.

    Attributes:
        line: First line of the element, from 1.
    """

    line: int


@dataclass(frozen=True, slots=True)
class PlacedShapes(UrdfElement):
    """A <visual> or <collision>.

    Attributes:
        shapes: Shapes of the element; a valid URDF has one.
        origin: Pose in the link frame.
    """

    shapes: tuple[Shape, ...]
    origin: Origin


@dataclass(frozen=True, slots=True)
class Link(UrdfElement):
    """A link.

    Attributes:
        name: Name of the link.
        visuals: <visual> elements.
        collisions: <collision> elements.
    """

    name: str
    visuals: tuple[PlacedShapes, ...]
    collisions: tuple[PlacedShapes, ...]


@dataclass(frozen=True, slots=True)
class Limit:
    """A <limit>.

    Attributes:
        lower: Lower position limit [rad or m].
        upper: Upper position limit [rad or m].
        effort: Effort limit [N m or N]; None if not given.
        velocity: Velocity limit [rad/s or m/s]; None if not given.
    """

    lower: float
    upper: float
    effort: float | None
    velocity: float | None


@dataclass(frozen=True, slots=True)
class SafetyController:
    """A <safety_controller>: range [rad or m] and gains of ros_control's soft limits; None if not given."""

    soft_lower_limit: float | None
    soft_upper_limit: float | None
    k_position: float | None
    k_velocity: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint(UrdfElement):
    """A joint.

    Attributes:
        name: Name of the joint.
        kind: URDF type.
        parent: Parent link; "" if not given.
        child: Child link; "" if not given.
        origin: Pose in the parent frame.
        axis: Axis in the joint frame.
        limit: Limits, or None.
        safety: Soft limits, or None.
        mimic: Relation to the leading joint, or None.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Origin
    axis: Vector
    limit: Limit | None
    safety: SafetyController | None
    mimic: Mimic | None

    @property
    def is_movable(self) -> bool:
        """Whether the joint type is movable."""
        return self.kind in MOVABLE_KINDS


class LocatedText(NamedTuple):
    """Stripped text of an element and its line."""

    text: str
    line: int


@dataclass(frozen=True, slots=True)
class TransmissionPart(UrdfElement):
    """A <joint> or <actuator> of a transmission; None if not given."""

    tag: str
    name: str
    role: str
    reduction: LocatedText | None
    offset: LocatedText | None
    interfaces: tuple[LocatedText, ...]


@dataclass(frozen=True, slots=True)
class Transmission(UrdfElement):
    """A <transmission> as written in the URDF."""

    name: str
    kind: str
    joints: tuple[TransmissionPart, ...]
    actuators: tuple[TransmissionPart, ...]


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot with its elements in file order."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    transmissions: tuple[Transmission, ...]

    def movable_joints(self) -> Iterator[Joint]:
        """Yields the movable joints."""
        return (joint for joint in self.joints if joint.is_movable)

    def root_links(self) -> list[str]:
        """Returns the names of the links without parent joint; a valid URDF has one."""
        children = {joint.child for joint in self.joints}
        return [link.name for link in self.links if link.name not in children]
