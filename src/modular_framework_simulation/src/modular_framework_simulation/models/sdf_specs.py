# SPDX-License-Identifier: BSD-3-Clause
"""Plain values for the contents of world and model files."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from enum import Enum
from pathlib import Path

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_urdf.robot import Box as Box
from modular_framework_urdf.robot import Cylinder as Cylinder
from modular_framework_urdf.robot import Sphere as Sphere
from modular_framework_urdf.rotations import Vector3

WORLD = "world"
"""Name of the world as a parent of joints."""

UNLIMITED_FRICTION = 1e6
"""Coefficient that replaces Gazebo's -1, which stands for surfaces that never slide."""

Colour = tuple[float, float, float, float]
"""RGBA in [0, 1]."""

GREY: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of shapes without a material."""


@dataclass(frozen=True, slots=True)
class Plane:
    """Infinite plane through the origin of its frame.

    Attributes:
        normal: Unit normal, pointing out of the solid half-space.
        size: Edge lengths of the drawn rectangle [m]; the collision shape is infinite.
    """

    normal: Vector3
    size: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangle mesh file (stl, obj, ply or dae), or a part of the file.

    Attributes:
        path: Path of the file.
        scale: Scale factors along x, y, z.
        submesh: Name of the only node to use; empty for all nodes.
        center: Whether the submesh is moved so that its bounding box is centred on the origin.
        location: File, line and element that name the mesh, for error messages.
    """

    path: Path
    scale: Vector3 = (1.0, 1.0, 1.0)
    submesh: str = ""
    center: bool = False
    location: str = field(default="", compare=False, repr=False)

    @property
    def place(self) -> str:
        """Returns the mesh file and the element that names the mesh, for the start of an error message."""
        return f"{self.location}: mesh file {self.path}" if self.location else f"mesh file {self.path}"


class JointType(Enum):
    """Joint types of a simulated model."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    BALL = "ball"


Geometry = Box | Cylinder | Sphere | Plane | Mesh


@dataclass(frozen=True, slots=True)
class Friction:
    """Friction coefficients of a surface; None if the file does not give a value.

    Attributes:
        lateral: Coulomb coefficient of sliding friction (`mu`), dimensionless.
        torsional: Resistance against spinning about the contact normal [m].
        rolling: Resistance against rolling [m].
        mu2: Coulomb coefficient of sliding friction in the second direction, dimensionless.
    """

    lateral: float = 1.0
    torsional: float | None = None
    rolling: float | None = None
    mu2: float | None = None


@dataclass(frozen=True, slots=True)
class Bounce:
    """Bounce of a surface.

    Attributes:
        restitution_coefficient: Coefficient of restitution, 0 (no bounce) to 1 (no loss).
        threshold: Minimum impact velocity for a bounce [m/s].
    """

    restitution_coefficient: float = 0.0
    threshold: float = 1e5


@dataclass(frozen=True, slots=True)
class SurfaceContact:
    """Contact properties of a surface; None if the file does not give a value.

    Attributes:
        kp: Stiffness [N/m].
        kd: Damping [N s/m].
        max_vel: Maximum velocity of the penetration correction [m/s].
        min_depth: Penetration that is not corrected [m].
        collide_without_contact: Whether the shape only reports contacts, without contact forces.
        collide_bitmask: Bit mask; two shapes collide if their masks have a common bit.
    """

    kp: float | None = None
    kd: float | None = None
    max_vel: float | None = None
    min_depth: float | None = None
    collide_without_contact: bool = False
    collide_bitmask: int = 0xFFFF


@dataclass(frozen=True, slots=True)
class Collision:
    """Collision shape of a link, with its pose in the link frame."""

    name: str
    pose: Pose
    geometry: Geometry
    friction: Friction
    bounce: Bounce = Bounce()
    contact: SurfaceContact = SurfaceContact()


@dataclass(frozen=True, slots=True)
class Visual:
    """Visible shape of a link.

    Attributes:
        name: Name in the file.
        pose: Pose in the link frame.
        geometry: The shape.
        colour: Colour of the shape; with `own_materials`, the colour of the parts without a material.
        texture: Image file of the texture; None for a plain colour.
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
        mass: Mass [kg].
        inertia: ixx, ixy, ixz, iyy, iyz, izz about the centre of mass [kg m^2].
    """

    pose: Pose
    mass: float
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class VelocityDecay:
    """Fraction of the velocity that a link loses in every step of Gazebo, which is 1 ms by default."""

    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True)
class Link:
    """Rigid body of a model.

    Attributes:
        name: Unique name in the model; "inner::link" for a link of an inner model.
        pose: Pose in the model frame.
        inertial: Mass properties; None for SDF's default of 1 kg and moments of 1 kg m^2.
        collisions: Collision shapes, in file order.
        visuals: Visible shapes, in file order.
        velocity_decay: Damping of the motion.
        gravity: Whether gravity acts on the link.
        kinematic: Whether forces do not move the link.
        self_collide: Whether the link collides with other links of its model; None for the model's setting.
    """

    name: str
    pose: Pose
    inertial: Inertial | None
    collisions: tuple[Collision, ...]
    visuals: tuple[Visual, ...]
    _: KW_ONLY
    velocity_decay: VelocityDecay = VelocityDecay()
    gravity: bool = True
    kinematic: bool = False
    self_collide: bool | None = None


@dataclass(frozen=True, slots=True)
class JointDynamics:
    """Passive forces of a joint.

    Attributes:
        damping: Viscous damping [N m s/rad or N s/m].
        friction: Static friction [N m or N].
        spring_reference: Equilibrium position of the spring [rad or m].
        spring_stiffness: Spring stiffness [N m/rad or N/m].
    """

    damping: float = 0.0
    friction: float = 0.0
    spring_reference: float = 0.0
    spring_stiffness: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """Joint between two links of a model.

    Attributes:
        name: Unique name in the model.
        kind: Type of the joint.
        parent: Name of the parent link, or "world".
        child: Name of the child link.
        pose: Pose of the joint frame in the child link frame.
        axis: Unit vector of the axis in the joint frame.
        lower: Lower limit [rad or m].
        upper: Upper limit [rad or m].
        effort: Maximum effort of a drive [N m or N].
        velocity: Maximum velocity [rad/s or m/s].
        dynamics: Passive forces.
        location: File, line and element of the description.
    """

    name: str
    kind: JointType
    parent: str
    child: str
    _: KW_ONLY
    pose: Pose
    axis: Vector3
    lower: float
    upper: float
    effort: float = math.inf
    velocity: float = math.inf
    dynamics: JointDynamics = JointDynamics()
    location: str = ""


@dataclass(frozen=True, slots=True)
class SensorElement:
    """A <sensor> element, or a <plugin> element of a model that may be a sensor.

    Attributes:
        node: The element.
        link: Name of the link, or of the child link of the joint; empty for a <plugin>.
        joint: Name of the joint; empty for a sensor of a link.
        pose: Pose in the link frame; None if the element's own <pose> applies.
        reference: Attribute `reference` of the enclosing <gazebo> element of a URDF.
        scope: Prefix "inner::" of names in an inner model; empty for the outer model.
    """

    node: XmlNode
    link: str = ""
    joint: str = ""
    pose: Pose | None = None
    reference: str = ""
    scope: str = ""


@dataclass(frozen=True, slots=True)
class Model:
    """Named set of links.

    Attributes:
        name: Name of the model in the world.
        pose: Pose of the model frame in the world frame.
        static: Whether the model never moves.
        links: Links in file order, followed by links of inner models; the first link is the canonical link.
        joints: Joints in file order.
        source: File (or other origin) of the description.
        self_collide: Whether the links collide with each other, unless a link has its own setting.
        notes: Notes on elements that have no effect or are replaced, as "file:line: text".
        sensors: Elements that are or may be sensors.
        namespace: Default namespace of the sensors' topics.
    """

    name: str
    pose: Pose
    static: bool
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    source: str
    _: KW_ONLY
    self_collide: bool = False
    notes: tuple[str, ...] = ()
    sensors: tuple[SensorElement, ...] = ()
    namespace: str = ""


@dataclass(frozen=True, slots=True)
class World:
    """Contents of a world file.

    Attributes:
        name: Name of the world.
        gravity: Gravity vector in the world frame [m/s^2].
        models: Models in file order.
        ignored: Ignored elements, as "file:line: <element>", without elements of the world's appearance.
        step_s: Physics step of the file [s]; None if the file has none.
        unknown: Elements and attributes of the world and of included models that SDF does not define.
    """

    name: str
    gravity: Vector3
    models: tuple[Model, ...]
    ignored: tuple[str, ...]
    step_s: float | None = None
    unknown: tuple[str, ...] = ()


def collision_object_id(model: str, link: str) -> str:
    """Returns the ID of a simulated link in the planning scene."""
    return f"{model}__{link}"
