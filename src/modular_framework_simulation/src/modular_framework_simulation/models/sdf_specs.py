# SPDX-License-Identifier: BSD-3-Clause
"""The contents of a world or model file, as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.robot import Box as Box
from modular_framework_urdf.robot import Cylinder as Cylinder
from modular_framework_urdf.robot import Sphere as Sphere
from modular_framework_urdf.rotations import Vector3


@dataclass(frozen=True, slots=True)
class Plane:
    """An infinite plane through its frame's origin.

    Attributes:
        normal: Unit vector out of the solid half-space.
        size: Edge lengths to draw [m]; collisions are infinite.
    """

    normal: Vector3
    size: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Mesh:
    """A triangle mesh file (stl, obj or dae) with a scale for each axis."""

    path: Path
    scale: Vector3 = (1.0, 1.0, 1.0)


class JointType(Enum):
    """The joints a simulated model may have."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"


Geometry = Box | Cylinder | Sphere | Plane | Mesh


@dataclass(frozen=True, slots=True)
class Friction:
    """Coulomb friction coefficients of a surface.

    Attributes:
        lateral: Resistance against sliding, dimensionless.
        torsional: Resistance against spinning about the contact normal [m], None when the file does not say.
        rolling: Resistance against rolling [m], None when the file does not say.
    """

    lateral: float = 1.0
    torsional: float | None = None
    rolling: float | None = None


@dataclass(frozen=True, slots=True)
class Collision:
    """One collision shape of a link; the pose is in the link frame."""

    name: str
    pose: Pose
    geometry: Geometry
    friction: Friction


@dataclass(frozen=True, slots=True)
class Visual:
    """One visible shape of a link; the pose is in the link frame, the colour RGBA in [0, 1]."""

    name: str
    pose: Pose
    geometry: Geometry
    colour: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass properties of a link.

    Attributes:
        pose: Centre of mass and inertia axes in the link frame.
        mass: [kg]
        inertia: ixx, ixy, ixz, iyy, iyz, izz about the centre of mass [kg m^2].
    """

    pose: Pose
    mass: float
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body of a model; the pose is in the model frame. No inertial: 1 kg, as SDF defines."""

    name: str
    pose: Pose
    inertial: Inertial | None
    collisions: tuple[Collision, ...]
    visuals: tuple[Visual, ...]


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links of a model.

    Attributes:
        name: Unique in the model.
        kind: What the joint lets move.
        parent: Name of the parent link.
        child: Name of the child link.
        pose: Joint frame in the child link frame.
        axis: Unit vector in the joint frame.
        lower: Lower limit [rad or m].
        upper: Upper limit [rad or m].
    """

    name: str
    kind: JointType
    parent: str
    child: str
    pose: Pose
    axis: Vector3
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class Model:
    """A named set of links.

    Attributes:
        name: Instance name in the world.
        pose: Model frame in the world frame.
        static: Never moves.
        links: In file order; the first is the canonical link.
        joints: In file order.
        source: File (or other origin) of the description.
    """

    name: str
    pose: Pose
    static: bool
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    source: str


@dataclass(frozen=True, slots=True)
class World:
    """A world file.

    Attributes:
        name: Name of the world.
        gravity: [m/s^2]
        models: In file order.
        ignored: Elements that were read over, each as "file:line: <element>".
    """

    name: str
    gravity: Vector3
    models: tuple[Model, ...]
    ignored: tuple[str, ...]
