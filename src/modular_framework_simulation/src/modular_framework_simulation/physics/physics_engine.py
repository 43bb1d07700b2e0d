# SPDX-License-Identifier: BSD-3-Clause
"""Interface between the simulated world and a physics engine; `engine_choice` lists the engines.

Bodies are trees of links and have ids that the engine assigns. Link indices start at 0, and each joint has the index of
its child link; the root link has the index `BASE_INDEX`. Poses and velocities are in the world frame [m, rad, m/s,
rad/s], quaternions are xyzw. The centre of a link is a frame in the centre of mass along the inertia axes. All calls
must come from one thread.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf import xml_text
from modular_framework_urdf.rotations import Quaternion, Vector3

BASE_INDEX = -1
"""Index of a body's root link."""

REST_LOOK_S = 0.1
"""Period with which an engine checks for sleeping bodies [s of simulated time]."""

MAX_NAME_BYTES = 1023
"""Maximum length of names and file names; PyBullet copies them into arrays of 1,024 bytes without a check."""

MAX_SHOWN_CHARACTERS = 40
"""Maximum number of characters of a name in a message."""
_NAMING_ATTRIBUTES = ("name", "link", "filename")

Log = Callable[[str], None]


class JointKind(Enum):
    """Type of a joint's motion."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    BALL = "ball"
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineJoint:
    """Joint in the engine.

    Attributes:
        index: Index of the joint and of its child link.
        name: Name of the joint.
        child_link: Name of the child link.
        kind: Type of the motion.
        lower: Lower limit, or -inf [rad or m].
        upper: Upper limit, or inf [rad or m].
        damping: Damping in the description [Nm s/rad or N s/m].
        friction: Friction in the description [Nm or N].
    """

    index: int
    name: str
    child_link: str
    kind: JointKind
    lower: float
    upper: float
    damping: float
    friction: float


class JointState(NamedTuple):
    """Position [rad or m], velocity [rad/s or m/s] and motor effort in the last step [Nm or N] of a joint."""

    position: float
    velocity: float
    effort: float


class LinkMotion(NamedTuple):
    """Poses of the centre and the frame of a link, and linear and angular velocity of the centre."""

    centre: Pose
    frame: Pose
    linear: Vector3
    angular: Vector3


class MassProperties(NamedTuple):
    """Mass [kg] (0 for a fixed root), moments about the inertia axes [kg m^2], and centre in the link frame."""

    mass: float
    moments: Vector3
    centre_in_link: Pose


class LinkContact(NamedTuple):
    """Contact with another body: its id, normal force [N] and distance [m], which is negative for penetration."""

    other: int
    force: float
    distance: float


@dataclass(frozen=True, slots=True)
class EngineContact:
    """Contact point between two links, in the world frame.

    Attributes:
        number: Id of the other body.
        index: Index of the other link.
        position: Midpoint between the two surfaces [m].
        normal: Unit normal that points out of the other body.
        distance: Distance [m], negative for penetration.
        force: Force on the first link, including friction [N].
    """

    number: int
    index: int
    position: Vector3
    normal: Vector3
    distance: float
    force: Vector3


@dataclass(frozen=True, slots=True)
class Surface:
    """Surface coefficients of a link, see `specs.Friction`, `specs.Bounce` and `specs.SurfaceContact`."""

    lateral: float
    spinning: float
    rolling: float
    restitution: float = 0.0
    kp: float | None = None
    kd: float | None = None


def refuse_long_names(text: str, location: str) -> None:
    """Raises DescriptionError if a name or file name in a URDF is too long for an engine.

    Args:
        text: URDF text.
        location: Location for the error message.
    """
    for element in xml_text.parse(text, location).iter():
        for key in _NAMING_ATTRIBUTES:
            value = element.get(key, "")
            size = len(value.encode())
            if size > MAX_NAME_BYTES:
                raise DescriptionError(
                    f"{location}: <{element.tag} {key}='{value[:MAX_SHOWN_CHARACTERS]}...'>",
                    f"is {size:,} bytes long",
                    f"the physics engine takes at most {MAX_NAME_BYTES:,} bytes; use a shorter name",
                )


class PhysicsEngine(ABC):
    """Physics engine.

    Attributes:
        name: Name of the engine in the parameter ~physics_engine.
        settings: Settings of the engine.
        has_window: Whether the engine shows the simulation in a window.
        takes_concave_meshes: Whether static bodies may have concave meshes.
    """

    name: str
    settings: PhysicsSettings
    has_window: bool
    takes_concave_meshes: bool

    # The world as a whole

    @abstractmethod
    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Changes settings and gravity.

        Args:
            settings: Settings of the engine.
            gravity: Gravity vector in the world frame [m/s^2].
        """

    @abstractmethod
    def restart(self, gravity: Vector3) -> None:
        """Removes all bodies, contacts and caches.

        Args:
            gravity: Gravity vector in the world frame [m/s^2].
        """

    @abstractmethod
    def step(self) -> None:
        """Advances the physics by one time step; applied forces and efforts end with the step."""

    @abstractmethod
    def resting(self) -> Collection[int]:
        """Returns the static and sleeping bodies; motion of a sleeping body is detected within REST_LOOK_S."""

    @abstractmethod
    def motionless(self) -> Collection[int]:
        """Returns the bodies that cannot have moved in the last step, without delay: a subset of `resting`."""

    @abstractmethod
    def save_state(self) -> Any:
        """Returns the state of all bodies, which `restore_state` can restore while the bodies are the same.

        Raises:
            SimulationError: Sleeping bodies are enabled (`rest_speed`), and the engine's state does not include them.
        """

    @abstractmethod
    def restore_state(self, state: Any) -> None:
        """Continues from a saved state, with bitwise identical results."""

    @abstractmethod
    def forget_state(self, state: Any) -> None:
        """Deletes a saved state."""

    @abstractmethod
    def close(self) -> None:
        """Closes the engine; may be called twice."""

    # Bodies

    @abstractmethod
    def load_urdf(self, text: str, name: str, fixed: bool, self_collision: bool = False) -> int:
        """Loads a body at the world origin.

        Args:
            text: URDF with absolute mesh paths.
            name: Name of the model for the error message.
            fixed: Whether the root link is fixed to the world.
            self_collision: Whether the links collide with each other.

        Returns:
            Id of the body.

        Raises:
            DescriptionError: The engine rejects the description, or a name is too long for the engine.
        """

    @abstractmethod
    def remove_body(self, number: int) -> None:
        """Removes a body."""

    @abstractmethod
    def root_link(self, number: int) -> str:
        """Returns the name of the root link."""

    @abstractmethod
    def joints(self, number: int) -> list[EngineJoint]:
        """Returns all joints of a body, including fixed joints, sorted by index."""

    @abstractmethod
    def mass_properties(self, number: int, index: int) -> MassProperties:
        """Returns the mass properties of a link."""

    @abstractmethod
    def mass_matrix(self, number: int, indices: Sequence[int]) -> npt.NDArray[np.float64]:
        """Returns the joint space inertia matrix at the current positions; the last rows are the movable joints.

        Args:
            number: Id of a body without ball joints.
            indices: Indices of all revolute and prismatic joints.
        """

    @abstractmethod
    def set_self_collisions(self, number: int, allowed: Collection[frozenset[int]]) -> None:
        """Sets the pairs of links that collide in a body loaded with `self_collision`; other pairs do not collide."""

    @abstractmethod
    def set_surface(self, number: int, index: int, surface: Surface, anchored: bool = False) -> None:
        """Sets friction, bounce and softness of a link.

        Args:
            number: Id of the body.
            index: Index of the link.
            surface: Coefficients; a contact uses the smaller friction and restitution of its two surfaces.
            anchored: Whether contacts have friction anchors, see `PhysicsSettings.friction_erp`.
        """

    @abstractmethod
    def remove_margin(self, number: int, index: int) -> None:
        """Removes the collision margin of a link's shapes, for engines with margins."""

    @abstractmethod
    def remove_velocity_damping(self, number: int) -> None:
        """Removes the velocity damping of a body, for engines that damp all bodies."""

    # Motion

    @abstractmethod
    def base_centre(self, number: int) -> Pose:
        """Returns the pose of the root link's centre."""

    @abstractmethod
    def base_twist(self, number: int) -> tuple[Vector3, Vector3]:
        """Returns linear and angular velocity of the root link's centre."""

    @abstractmethod
    def set_base_centre(self, number: int, pose: Pose) -> None:
        """Sets the pose of the root link's centre, with the root link at rest."""

    @abstractmethod
    def set_base_twist(self, number: int, linear: Vector3, angular: Vector3) -> None:
        """Sets the velocity of the root link's centre of mass.

        Args:
            number: Id of the body.
            linear: Linear velocity in the world frame [m/s].
            angular: Angular velocity in the world frame [rad/s].
        """

    @abstractmethod
    def link_motion(self, number: int, index: int) -> LinkMotion:
        """Returns pose and velocity of a link other than the root."""

    @abstractmethod
    def weld(self, number: int, index: int, other: int) -> int:
        """Welds the root link of another body to a link, at their current relative pose.

        Args:
            number: Id of the body with the link.
            index: Index of the link.
            other: Id of the other body.

        Returns:
            Id of the weld.
        """

    @abstractmethod
    def remove_weld(self, weld: int) -> None:
        """Removes a weld; must be called before one of its bodies is removed."""

    @abstractmethod
    def apply_force(self, number: int, index: int, force: Sequence[float], point: Vector3) -> None:
        """Applies a force at a point of a link in the next step.

        Args:
            number: Id of the body.
            index: Index of the link.
            force: Force in the world frame [N].
            point: Point in the world frame [m].
        """

    @abstractmethod
    def link_contacts(self, number: int, index: int) -> list[LinkContact]:
        """Returns the contacts of a link with other bodies in the last step; a near body has force 0."""

    @abstractmethod
    def touched_bodies(self, number: int) -> set[int]:
        """Returns the ids of the bodies that any link of a body pressed on in the last step.

        The contacts of a sleeping body may be unknown; its neighbours stay asleep.
        """

    @abstractmethod
    def contact_points(self, number: int, index: int) -> list[EngineContact]:
        """Returns the contact points of a link in the last step, with forces; near bodies are left out."""

    # Joints

    @abstractmethod
    def joint_states(self, number: int, indices: Sequence[int]) -> list[JointState]:
        """Returns the states of revolute and prismatic joints."""

    @abstractmethod
    def set_joint_state(self, number: int, index: int, position: float, velocity: float) -> None:
        """Sets the state of a joint.

        Args:
            number: Id of the body.
            index: Index of the joint.
            position: Position [rad or m].
            velocity: Velocity [rad/s or m/s].
        """

    @abstractmethod
    def ball_joint_state(self, number: int, index: int) -> tuple[Quaternion, Vector3]:
        """Returns rotation (quaternion xyzw) and angular velocity [rad/s] of a ball joint."""

    @abstractmethod
    def set_ball_joint_state(self, number: int, index: int, rotation: Quaternion, rate: Vector3) -> None:
        """Sets the state of a ball joint.

        Args:
            number: Id of the body.
            index: Index of the joint.
            rotation: Rotation, quaternion xyzw.
            rate: Angular velocity [rad/s].
        """

    @abstractmethod
    def release_ball_joint(self, number: int, index: int) -> None:
        """Removes the default motor of a ball joint, for engines with default motors."""

    @abstractmethod
    def set_joint_damping(self, number: int, index: int, damping: float) -> None:
        """Sets the viscous damping of a joint in the explicit step.

        Args:
            number: Id of the body.
            index: Index of the joint.
            damping: Damping [Nm s/rad or N s/m].
        """

    @abstractmethod
    def set_position_motors(
        self,
        number: int,
        indices: Sequence[int],
        targets: Sequence[float],
        *,
        velocities: Sequence[float],
        efforts: Sequence[float],
        gain: float,
    ) -> None:
        """Sets motors that move joints to positions within their maximum effort.

        Args:
            number: Id of the body.
            indices: Indices of the joints.
            targets: Target positions [rad or m].
            velocities: Feed-forward velocities [rad/s or m/s].
            efforts: Maximum efforts [Nm or N].
            gain: Fraction of a position error that is corrected in one step.
        """

    @abstractmethod
    def set_velocity_motor(self, number: int, index: int, velocity: float, effort: float) -> None:
        """Sets a motor that moves a joint at a velocity.

        Args:
            number: Id of the body.
            index: Index of the joint.
            velocity: Target velocity [rad/s or m/s].
            effort: Maximum effort [Nm or N].
        """

    @abstractmethod
    def apply_effort(self, number: int, index: int, effort: float) -> None:
        """Adds an effort to a joint in the next step, in addition to its motor and other efforts.

        Args:
            number: Id of the body.
            index: Index of the joint.
            effort: Effort [Nm or N].
        """

    @abstractmethod
    def measure_joint_load(self, number: int, index: int) -> None:
        """Enables `joint_load` for the next steps."""

    @abstractmethod
    def joint_load(self, number: int, index: int) -> tuple[Vector3, Vector3]:
        """Returns the force [N] and torque [Nm] of a joint's child link on the parent link in the last step.

        Both are in the frame of the child link, and the torque is about its origin.
        """
