# SPDX-License-Identifier: BSD-3-Clause
"""What the simulated world asks of a physics engine; `engine_choice` says which engines there are.

Bodies are trees of links, numbered by the engine. Link 0 and the joint 0 above it come first in the tree; the root is
`BASE_INDEX`. Poses and velocities are in the world frame [m, rad, m/s, rad/s], quaternions xyzw. The centre of a link
is the frame in its centre of mass whose axes are those of its inertia. All calls come from one thread.
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
"""The number of a body's root link."""

REST_LOOK_S = 0.1
"""Period with which an engine that lets bodies rest looks which of them do [s of simulated time]."""

LONGEST_NAME_BYTES = 1023
"""PyBullet copies names and file names into arrays of 1,024 bytes without checking their length, and crashes."""

SHOWN_CHARACTERS = 40
"""Of a name in a message."""
_NAMING_ATTRIBUTES = ("name", "link", "filename")

Log = Callable[[str], None]


class JointKind(Enum):
    """How a joint moves."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    BALL = "ball"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class EngineJoint:
    """A joint as the engine has it.

    Attributes:
        index: Its number, and that of the link below it.
        name: Its name.
        child_link: Name of the link below it.
        kind: How it moves.
        lower: Lower limit, -inf without [rad or m].
        upper: Upper limit, inf without [rad or m].
        damping: Of its description [Nm s/rad or N s/m].
        friction: Of its description [Nm or N].
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
    """Position [rad or m], velocity [rad/s or m/s], and what its motor did in the last step [Nm or N]."""

    position: float
    velocity: float
    effort: float


class LinkMotion(NamedTuple):
    """Where the centre and the frame of a link are, and how the centre moves."""

    centre: Pose
    frame: Pose
    linear: Vector3
    angular: Vector3


class MassProperties(NamedTuple):
    """Mass [kg] (0: fastened to the world), moments about the axes of the centre [kg m^2], centre in the link frame."""

    mass: float
    moments: Vector3
    centre_in_link: Pose


class Touch(NamedTuple):
    """A point where a link touches another body: that body's number, normal force [N], distance [m] (< 0: inside)."""

    other: int
    force: float
    distance: float


@dataclass(frozen=True, slots=True)
class EngineContact:
    """A point where two links touch, in the world.

    Attributes:
        number: Of the other body.
        index: Of its link.
        position: Half way between the two surfaces [m].
        normal: Unit vector out of the other body.
        distance: Negative when they are in each other [m].
        force: On the first link, friction too [N].
    """

    number: int
    index: int
    position: Vector3
    normal: Vector3
    distance: float
    force: Vector3


@dataclass(frozen=True, slots=True)
class Surface:
    """Coefficients of a link; see `specs.Friction`, `specs.Bounce` and `specs.SurfaceContact`."""

    lateral: float
    spinning: float
    rolling: float
    restitution: float = 0.0
    kp: float | None = None
    kd: float | None = None


def refuse_long_names(text: str, where: str) -> None:
    """Raises DescriptionError where a URDF holds a name, or the name of a file, that an engine has no room for.

    Args:
        text: The URDF.
        where: Named in the error.
    """
    for element in xml_text.parse(text, where).iter():
        for key in _NAMING_ATTRIBUTES:
            value = element.get(key, "")
            size = len(value.encode())
            if size > LONGEST_NAME_BYTES:
                raise DescriptionError(
                    f"{where}: <{element.tag} {key}='{value[:SHOWN_CHARACTERS]}...'>",
                    f"is {size:,} bytes long",
                    f"the physics engine takes at most {LONGEST_NAME_BYTES:,} bytes; use a shorter name",
                )


class PhysicsEngine(ABC):
    """A physics engine.

    Attributes:
        name: As the parameter ~physics_engine has it.
        settings: Its numbers.
        has_window: Whether it shows what it simulates.
        takes_concave_meshes: Whether the shapes of bodies that never move may be meshes that are not convex.
    """

    name: str
    settings: PhysicsSettings
    has_window: bool
    takes_concave_meshes: bool

    # The world as a whole

    @abstractmethod
    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Continues with other settings and gravity [m/s^2]."""

    @abstractmethod
    def restart(self, gravity: Vector3) -> None:
        """Takes everything out, contacts and their caches too; gravity in m/s^2."""

    @abstractmethod
    def step(self) -> None:
        """Advances the physics by one time step; forces and efforts that were applied end with it."""

    @abstractmethod
    def resting(self) -> Collection[int]:
        """Returns the bodies that have not moved for REST_LOOK_S; a touch that moved one is noticed in that time."""

    @abstractmethod
    def save_state(self) -> Any:
        """Returns the state of motion of everything, for `restore_state` while the same bodies are there.

        Raises:
            SimulationError: The engine leaves bodies at rest out (`rest_speed`), which is no part of its state.
        """

    @abstractmethod
    def restore_state(self, state: Any) -> None:
        """Continues from a saved state, bit for bit as from the first time."""

    @abstractmethod
    def forget_state(self, state: Any) -> None:
        """Frees a saved state."""

    @abstractmethod
    def close(self) -> None:
        """Ends the engine; may be called twice."""

    # Bodies

    @abstractmethod
    def load_urdf(self, text: str, name: str, fixed: bool, self_collision: bool = False) -> int:
        """Loads a body at the world origin.

        Args:
            text: URDF with absolute mesh paths.
            name: Named in the error.
            fixed: Whether its root link is fastened to the world.
            self_collision: Whether its links touch each other.

        Returns:
            The number of the body.

        Raises:
            DescriptionError: The engine refuses the description, or has no room for a name in it.
        """

    @abstractmethod
    def remove_body(self, number: int) -> None:
        """Takes a body out."""

    @abstractmethod
    def root_link(self, number: int) -> str:
        """Returns the name of the root link."""

    @abstractmethod
    def joints(self, number: int) -> list[EngineJoint]:
        """Returns every joint of a body, fixed ones too, in the order of their numbers."""

    @abstractmethod
    def mass_properties(self, number: int, index: int) -> MassProperties:
        """Returns the mass and its distribution in a link."""

    @abstractmethod
    def mass_matrix(self, number: int, indices: Sequence[int]) -> npt.NDArray[np.float64]:
        """Returns the joint space inertia where the joints are now; the last rows are those of the movable joints.

        Args:
            number: A body without ball joints.
            indices: All its joints that turn or slide.
        """

    @abstractmethod
    def set_self_collisions(self, number: int, allowed: Collection[frozenset[int]]) -> None:
        """Sets which pairs of links of a body loaded with `self_collision` touch each other; the others do not."""

    @abstractmethod
    def set_surface(self, number: int, index: int, surface: Surface, anchored: bool = False) -> None:
        """Sets friction, bounce and softness of a link.

        Args:
            number: The body.
            index: The link.
            surface: Its coefficients; of a contact, the smaller ones of friction and restitution count.
            anchored: Whether touches remember where they began, see `PhysicsSettings.friction_erp`.
        """

    @abstractmethod
    def remove_margin(self, number: int, index: int) -> None:
        """Lets the shapes of a link touch where they are, for engines that keep shapes apart by a margin."""

    @abstractmethod
    def remove_velocity_damping(self, number: int) -> None:
        """Lets a body spin and fly freely, for engines that brake every body."""

    # Motion

    @abstractmethod
    def base_centre(self, number: int) -> Pose:
        """Returns the pose of the root link's centre."""

    @abstractmethod
    def base_twist(self, number: int) -> tuple[Vector3, Vector3]:
        """Returns linear and angular velocity of the root link's centre."""

    @abstractmethod
    def set_base_centre(self, number: int, pose: Pose) -> None:
        """Puts a body somewhere, its root link at rest."""

    @abstractmethod
    def set_base_twist(self, number: int, linear: Vector3, angular: Vector3) -> None:
        """Sets the velocity of the root link's centre."""

    @abstractmethod
    def link_motion(self, number: int, index: int) -> LinkMotion:
        """Returns where a link other than the root is and how it moves."""

    @abstractmethod
    def weld(self, number: int, index: int, other: int) -> int:
        """Fastens the root link of another body to a link, as both are now.

        Returns:
            The number of the weld.
        """

    @abstractmethod
    def remove_weld(self, weld: int) -> None:
        """Ends a weld; to be called before one of its bodies is taken out."""

    @abstractmethod
    def apply_force(self, number: int, index: int, force: Sequence[float], point: Vector3) -> None:
        """Lets a force [N] act at a point of a link in the coming step, both in the world frame."""

    @abstractmethod
    def touches(self, number: int, index: int) -> list[Touch]:
        """Returns where a link touched others in the last step; also where it was just near, with force 0."""

    @abstractmethod
    def contact_points(self, number: int, index: int) -> list[EngineContact]:
        """Returns where a link touched others in the last step, with the whole force; not where it was just near."""

    # Joints

    @abstractmethod
    def joint_states(self, number: int, indices: Sequence[int]) -> list[JointState]:
        """Returns the states of joints that turn or slide."""

    @abstractmethod
    def set_joint_state(self, number: int, index: int, position: float, velocity: float) -> None:
        """Puts a joint somewhere, moving."""

    @abstractmethod
    def ball_joint_state(self, number: int, index: int) -> tuple[Quaternion, Vector3]:
        """Returns rotation and angular velocity of a ball joint."""

    @abstractmethod
    def set_ball_joint_state(self, number: int, index: int, turn: Quaternion, rate: Vector3) -> None:
        """Puts a ball joint somewhere, moving."""

    @abstractmethod
    def release_ball_joint(self, number: int, index: int) -> None:
        """Lets a ball joint turn freely, for engines that brake it with a motor of their own."""

    @abstractmethod
    def set_joint_damping(self, number: int, index: int, damping: float) -> None:
        """Sets the resistance of a joint per velocity, as the explicit step has it [Nm s/rad or N s/m]."""

    @abstractmethod
    def set_position_motors(
        self,
        number: int,
        indices: Sequence[int],
        targets: Sequence[float],
        velocities: Sequence[float],
        efforts: Sequence[float],
        gain: float,
    ) -> None:
        """Lets motors move joints to positions, with at most their effort.

        Args:
            number: The body.
            indices: The joints.
            targets: Positions [rad or m].
            velocities: Fed forward [rad/s or m/s].
            efforts: Most that each motor has [Nm or N].
            gain: Share of a position error that is corrected in one step.
        """

    @abstractmethod
    def set_velocity_motor(self, number: int, index: int, velocity: float, effort: float) -> None:
        """Lets a motor bring a joint to a velocity [rad/s or m/s] with at most an effort [Nm or N]."""

    @abstractmethod
    def apply_effort(self, number: int, index: int, effort: float) -> None:
        """Lets an effort [Nm or N] act on a joint in the coming step, besides that of its motor; several add up."""

    @abstractmethod
    def measure_joint_load(self, number: int, index: int) -> None:
        """Lets `joint_load` be measured in the coming steps."""

    @abstractmethod
    def joint_load(self, number: int, index: int) -> tuple[Vector3, Vector3]:
        """Returns the force [N] and torque [Nm] with which the link below a joint acted on the one above, last step.

        Both are in the axes of the link below, about its origin.
        """
