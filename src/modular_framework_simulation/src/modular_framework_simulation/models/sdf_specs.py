# SPDX-License-Identifier: BSD-3-Clause
"""The contents of a world or model file, as plain values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_urdf.robot import Box as Box
from modular_framework_urdf.robot import Cylinder as Cylinder
from modular_framework_urdf.robot import Sphere as Sphere
from modular_framework_urdf.rotations import Vector3

WORLD = "world"
"""The name that joints use for the world as their parent."""

UNLIMITED_FRICTION = 1e6
"""Stands for a coefficient of -1, with which Gazebo means that surfaces never slide."""

Colour = tuple[float, float, float, float]
"""RGBA in [0, 1]."""

GREY: Colour = (0.7, 0.7, 0.7, 1.0)
"""What has no material."""


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
    """A triangle mesh file (stl, obj, ply or dae), or a part of one.

    Attributes:
        path: The file.
        scale: Along each axis.
        submesh: Name of the only node of the file to take; empty for all of them.
        center: Whether the submesh is moved so that its bounding box is centred on the origin.
    """

    path: Path
    scale: Vector3 = (1.0, 1.0, 1.0)
    submesh: str = ""
    center: bool = False


class JointType(Enum):
    """The joints a simulated model may have."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    BALL = "ball"


Geometry = Box | Cylinder | Sphere | Plane | Mesh


@dataclass(frozen=True, slots=True)
class Friction:
    """Coulomb friction coefficients of a surface.

    Attributes:
        lateral: Resistance against sliding (`mu`), dimensionless.
        torsional: Resistance against spinning about the contact normal [m], None when the file does not say.
        rolling: Resistance against rolling [m], None when the file does not say.
        mu2: Resistance against sliding across the first direction, None when the file does not say.
    """

    lateral: float = 1.0
    torsional: float | None = None
    rolling: float | None = None
    mu2: float | None = None


@dataclass(frozen=True, slots=True)
class Bounce:
    """How a surface throws back what hits it.

    Attributes:
        restitution_coefficient: 0 (no bounce) to 1 (no loss).
        threshold: Slower impacts do not bounce [m/s].
    """

    restitution_coefficient: float = 0.0
    threshold: float = 1e5


@dataclass(frozen=True, slots=True)
class SurfaceContact:
    """How a surface gives way, None where the file does not say.

    Attributes:
        kp: Stiffness [N/m].
        kd: Damping [N s/m].
        max_vel: Largest velocity with which a penetration is corrected [m/s].
        min_depth: Penetration that is left as it is [m].
        collide_without_contact: Whether the shape only reports touches, and lets everything pass.
        collide_bitmask: Shapes touch where their masks share a bit.
    """

    kp: float | None = None
    kd: float | None = None
    max_vel: float | None = None
    min_depth: float | None = None
    collide_without_contact: bool = False
    collide_bitmask: int = 0xFFFF


@dataclass(frozen=True, slots=True)
class Collision:
    """One collision shape of a link; the pose is in the link frame."""

    name: str
    pose: Pose
    geometry: Geometry
    friction: Friction
    bounce: Bounce = Bounce()
    contact: SurfaceContact = SurfaceContact()


@dataclass(frozen=True, slots=True)
class Visual:
    """One visible shape of a link.

    Attributes:
        name: As in the file.
        pose: In the link frame.
        geometry: The shape.
        colour: Of the whole shape; where the file gives a mesh no colour, that of a part without a material of its own.
        texture: Image file drawn on the shape.
        own_materials: Whether a mesh is drawn with the materials of its own file.
    """

    name: str
    pose: Pose
    geometry: Geometry
    colour: Colour
    texture: Path | None = None
    own_materials: bool = False


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
class VelocityDecay:
    """Share of its velocity that a link loses in every step of Gazebo, of 1 ms by default."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body of a model.

    Attributes:
        name: Unique in the model; "inner::link" for a link of a model inside the model.
        pose: In the model frame.
        inertial: None: 1 kg and moments of 1 kg m^2, as SDF defines.
        collisions: In file order.
        visuals: In file order.
        velocity_decay: Damping of its motion.
        gravity: Whether gravity acts on it.
        kinematic: Whether forces do not move it.
        self_collide: Whether it touches other links of its model; None: as the model says.
    """

    name: str
    pose: Pose
    inertial: Inertial | None
    collisions: tuple[Collision, ...]
    visuals: tuple[Visual, ...]
    velocity_decay: VelocityDecay = VelocityDecay()
    gravity: bool = True
    kinematic: bool = False
    self_collide: bool | None = None


@dataclass(frozen=True, slots=True)
class JointDynamics:
    """Passive forces of a joint.

    Attributes:
        damping: [N m s/rad or N s/m]
        friction: Static friction [N m or N].
        spring_reference: Position where the spring is at rest [rad or m].
        spring_stiffness: [N m/rad or N/m]
    """

    damping: float = 0.0
    friction: float = 0.0
    spring_reference: float = 0.0
    spring_stiffness: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links of a model.

    Attributes:
        name: Unique in the model.
        kind: What the joint lets move.
        parent: Name of the parent link, or "world".
        child: Name of the child link.
        pose: Joint frame in the child link frame.
        axis: Unit vector in the joint frame.
        lower: Lower limit [rad or m].
        upper: Upper limit [rad or m].
        effort: Largest effort of a drive [N m or N].
        velocity: Largest velocity [rad/s or m/s].
        dynamics: Passive forces.
        where: File, line and element of its description.
    """

    name: str
    kind: JointType
    parent: str
    child: str
    pose: Pose
    axis: Vector3
    lower: float
    upper: float
    effort: float = math.inf
    velocity: float = math.inf
    dynamics: JointDynamics = JointDynamics()
    where: str = ""


@dataclass(frozen=True, slots=True)
class SensorElement:
    """A <sensor>, or a <plugin> of a model, which may be one, as the file has it.

    Attributes:
        node: The element.
        link: The link it is in, or the child of its joint; empty for a <plugin>.
        joint: The joint it is in; empty for one in a link.
        pose: In the frame of the link; None: as its own <pose> says.
        reference: What the <gazebo> of a URDF around it refers to.
        scope: "inner::" for one of an inner model, whose names its own are below.
    """

    node: XmlNode
    link: str = ""
    joint: str = ""
    pose: Pose | None = None
    reference: str = ""
    scope: str = ""


@dataclass(frozen=True, slots=True)
class Model:
    """A named set of links.

    Attributes:
        name: Instance name in the world.
        pose: Model frame in the world frame.
        static: Never moves.
        links: In file order, those of inner models last; the first is the canonical link.
        joints: In file order.
        source: File (or other origin) of the description.
        self_collide: Whether its links touch each other, unless a link says otherwise.
        notes: What has no effect here or was replaced, each as "file:line: what".
        sensors: Elements that are or may be sensors.
        namespace: Of the topics of its sensors, where they name none.
    """

    name: str
    pose: Pose
    static: bool
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    source: str
    self_collide: bool = False
    notes: tuple[str, ...] = ()
    sensors: tuple[SensorElement, ...] = ()
    namespace: str = ""


@dataclass(frozen=True, slots=True)
class World:
    """A world file.

    Attributes:
        name: Name of the world.
        gravity: [m/s^2]
        models: In file order.
        ignored: Elements that were read over, each as "file:line: <element>"; not those of the look of the world.
        step_s: Physics step that the file asks for [s]; None: none.
    """

    name: str
    gravity: Vector3
    models: tuple[Model, ...]
    ignored: tuple[str, ...]
    step_s: float | None = None
