# SPDX-License-Identifier: BSD-3-Clause
"""The contents of a URDF as plain records; `urdf_reader.read_urdf` makes them."""

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
    """A pose in the frame of the parent.

    Attributes:
        xyz: position [m].
        rpy: turns about the fixed axes x, y and z, in this order [rad].
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
    """Its edges along x, y and z [m]."""

    tag: ClassVar[str] = "box"
    size: Vector


@dataclass(frozen=True, slots=True)
class Sphere:
    """Its radius [m]."""

    tag: ClassVar[str] = "sphere"
    radius: float


@dataclass(frozen=True, slots=True)
class _RoundShape:
    """A shape around the z axis, by its radius and its length [m]."""

    radius: float
    length: float


class Cylinder(_RoundShape):
    """A cylinder."""

    tag: ClassVar[str] = "cylinder"


class Capsule(_RoundShape):
    """A cylinder with half spheres on both ends, which its length leaves out."""

    tag: ClassVar[str] = "capsule"


@dataclass(frozen=True, slots=True)
class MeshFile:
    """URI of a mesh file, and by what it is scaled along x, y and z."""

    tag: ClassVar[str] = "mesh"
    uri: str
    scale: Vector


@dataclass(frozen=True, slots=True)
class UnknownShape:
    """A shape that URDF does not have."""

    tag: str


Shape = Box | Sphere | Cylinder | Capsule | MeshFile | UnknownShape


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfElement:
    """Base of what is an element of the description; `line` is where it begins."""

    line: int


@dataclass(frozen=True, slots=True)
class PlacedShapes(UrdfElement):
    """A <visual> or <collision>: its shapes (one, in a correct description), and their pose in the link."""

    shapes: tuple[Shape, ...]
    origin: Origin


@dataclass(frozen=True, slots=True)
class Link(UrdfElement):
    """A link.

    Attributes:
        name: of the link.
        visuals: its <visual> elements.
        collisions: its <collision> elements.
    """

    name: str
    visuals: tuple[PlacedShapes, ...]
    collisions: tuple[PlacedShapes, ...]


@dataclass(frozen=True, slots=True)
class Limit:
    """A <limit>; None is not given.

    Attributes:
        lower: the least position [rad or m].
        upper: the greatest position [rad or m].
        effort: the largest [N m or N].
        velocity: the largest [rad/s or m/s].
    """

    lower: float
    upper: float
    effort: float | None
    velocity: float | None


@dataclass(frozen=True, slots=True)
class SafetyController:
    """A <safety_controller>: the range [rad or m] and gains of ros_control's soft limits; None is not given."""

    soft_lower_limit: float | None
    soft_upper_limit: float | None
    k_position: float | None
    k_velocity: float | None


@dataclass(frozen=True, slots=True)
class Joint(UrdfElement):
    """A joint.

    Attributes:
        name: of the joint.
        kind: the URDF type.
        parent: link it hangs on; empty when the description names none.
        child: link it carries; empty when the description names none.
        origin: pose in the parent link.
        axis: in the joint's own frame.
        limit: None without the element.
        safety: None without the element.
        mimic: the joint it follows directly; None when it follows none.
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
    def movable(self) -> bool:
        """Whether it is of a kind that moves."""
        return self.kind in MOVABLE_KINDS


class LocatedText(NamedTuple):
    """Text of an element, without the white space around it, and its line."""

    text: str
    line: int


@dataclass(frozen=True, slots=True)
class TransmissionPart(UrdfElement):
    """A <joint> or <actuator> of a transmission; None is not given."""

    tag: str
    name: str
    role: str
    reduction: LocatedText | None
    offset: LocatedText | None
    interfaces: tuple[LocatedText, ...]


@dataclass(frozen=True, slots=True)
class Transmission(UrdfElement):
    """A <transmission>, in the words of the file."""

    name: str
    kind: str
    joints: tuple[TransmissionPart, ...]
    actuators: tuple[TransmissionPart, ...]


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot; everything in the order of the file."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    transmissions: tuple[Transmission, ...]

    def movable_joints(self) -> Iterator[Joint]:
        """Yields the joints of kinds that move."""
        return (joint for joint in self.joints if joint.movable)

    def root_links(self) -> list[str]:
        """Returns the names of the links that no joint carries; a correct description has one."""
        carried = {joint.child for joint in self.joints}
        return [link.name for link in self.links if link.name not in carried]
