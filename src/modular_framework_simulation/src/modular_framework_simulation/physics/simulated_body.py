# SPDX-License-Identifier: BSD-3-Clause
"""A model as it is in the physics engine: converts between the engine's centre-of-mass frames and link frames."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Model
from modular_framework_simulation.physics.body_urdf import BodyUrdf
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, JointKind, PhysicsEngine
from modular_framework_urdf.rotations import Vector3, rotate_vector


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocities in the world frame: linear [m/s] of the frame's origin, and angular [rad/s]."""

    linear: Vector3 = (0.0, 0.0, 0.0)
    angular: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class BodyState:
    """Pose and velocity of a model or link."""

    pose: Pose
    twist: Twist


@dataclass(frozen=True, slots=True)
class JointSettings:
    """Settings of a joint that a request changed; None where its description decides.

    Attributes:
        damping: Resistance per velocity [Nm s/rad or N s/m].
        motor_velocity: What a motor in the joint wants [rad/s or m/s].
        motor_effort: What it has for that [Nm or N]; 0: there is no motor.
    """

    damping: float | None = None
    motor_velocity: float | None = None
    motor_effort: float | None = None


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Returns the cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def add(a: Vector3, b: Vector3) -> Vector3:
    """Returns the sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


class SimulatedBody:
    """One model in the engine.

    Args:
        engine: Where it lives.
        number: The engine's number of the body.
        name: Instance name.
        tree: How the engine has its links; None for a robot.
        static: Whether it never moves.
        spec: The model's description; None for a robot.

    Attributes:
        further: The other trees of a model whose joints do not connect all its links.
    """

    def __init__(
        self,
        engine: PhysicsEngine,
        number: int,
        name: str,
        tree: BodyUrdf | None,
        static: bool,
        spec: Model | None,
    ) -> None:
        self.number, self.name = number, name
        self.static, self.spec = static, spec
        self._engine = engine
        self.further: tuple[SimulatedBody, ...] = ()
        self._root_in_model = tree.root_in_model if tree is not None else Pose()
        self._model_in_root = self._root_in_model.inverse()
        frames = tree.frame_in_link if tree is not None else {}
        self._link_in_frame = {link: frame.inverse() for link, frame in frames.items()}
        self.joint_settings: dict[str, JointSettings] = {}
        joints = engine.joints(number)
        self.link_indices: dict[str, int] = {engine.root_link(number): BASE_INDEX}
        self.link_indices.update({joint.child_link: joint.index for joint in joints})
        self.joint_indices: dict[str, int] = {
            joint.name: joint.index for joint in joints if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC)
        }
        self.ball_joint_indices = tuple(joint.index for joint in joints if joint.kind is JointKind.BALL)
        self._centre_in_root = engine.mass_properties(number, BASE_INDEX).centre_in_link
        self._root_in_centre = self._centre_in_root.inverse()

    @property
    def parts(self) -> tuple[SimulatedBody, ...]:
        """All trees of the model, this one first."""
        return (self, *self.further)

    def part_of(self, link: str) -> SimulatedBody:
        """Returns the tree that a link of the model belongs to; this one where there is no such link."""
        return next((part for part in self.parts if link in part.link_indices), self)

    def link_of_number(self, number: int, link: int) -> str:
        """Returns the name of a link by the engine's numbers of one of the trees and of the link; "" for none."""
        part = next((each for each in self.parts if each.number == number), self)
        return next((name for name, index in part.link_indices.items() if index == link), "")

    def link_names(self) -> list[str]:
        """Returns the names of the links as its description has them."""
        if self.spec is not None:
            return [link.name for link in self.spec.links]
        return list(self.link_indices)

    def joint_names(self) -> list[str]:
        """Returns the names of the joints as its description has them; of a robot those that move."""
        if self.spec is not None:
            return [joint.name for joint in self.spec.joints]
        return list(self.joint_indices)

    def state(self) -> BodyState:
        """Returns pose and velocity of the model frame in the world."""
        centre_in_world, twist = self._centre_state()
        model_in_world = centre_in_world @ self._root_in_centre @ self._model_in_root
        return BodyState(model_in_world, twist_at(twist, centre_in_world, model_in_world))

    def link_state(self, link: str) -> BodyState:
        """Returns pose and velocity of a link frame in the world.

        Raises:
            UnknownEntityError: The model has no such link.
        """
        if self.static and self.spec is not None:
            for each in self.spec.links:
                if each.name == link:
                    return BodyState(self.state().pose @ each.pose, Twist())
        index = self.link_indices.get(link)
        if index is None and (part := self.part_of(link)) is not self:
            return part.link_state(link)
        if index is None:
            raise UnknownEntityError("link", f"{self.name}::{link}", [f"{self.name}::{n}" for n in self.link_names()])
        if index == BASE_INDEX:
            centre_in_world, twist = self._centre_state()
            link_in_world = centre_in_world @ self._root_in_centre
            return BodyState(link_in_world, twist_at(twist, centre_in_world, link_in_world))
        motion = self._engine.link_motion(self.number, index)
        link_in_world = motion.frame @ self._link_in_frame.get(link, Pose())
        return BodyState(link_in_world, twist_at(Twist(motion.linear, motion.angular), motion.centre, link_in_world))

    def set_state(self, state: BodyState) -> None:
        """Puts the model somewhere as one rigid body; its joints keep their positions.

        Args:
            state: Of the model frame, in the world frame.
        """
        model_in_world = self.state().pose if self.further else Pose()
        for part in self.further:
            part_in_world = state.pose @ model_in_world.inverse() @ part.state().pose
            part.set_state(BodyState(part_in_world, twist_at(state.twist, state.pose, part_in_world)))
        centre_in_world = state.pose @ self._root_in_model @ self._centre_in_root
        self._engine.set_base_centre(self.number, centre_in_world)
        if not self.static:
            twist = twist_at(state.twist, state.pose, centre_in_world)
            self._engine.set_base_twist(self.number, twist.linear, twist.angular)

    def release_ball_joints(self) -> None:
        """Lets ball joints turn freely: the engine would otherwise brake them with a motor of its own."""
        for index in self.ball_joint_indices:
            self._engine.release_ball_joint(self.number, index)

    def put_together(self, pose: Pose) -> None:
        """Puts the model somewhere at rest, with its trees where its description has them.

        Args:
            pose: Of the model frame, in the world frame.
        """
        for part in self.further:
            part.set_state(BodyState(self.state().pose, Twist()))
        self.set_state(BodyState(pose, Twist()))

    def set_joints(self, positions: dict[str, float]) -> None:
        """Puts joints at positions [rad or m], at rest; joints that are not named stay.

        Raises:
            UnknownEntityError: The model has no such movable joint.
        """
        owners = {name: part for part in self.parts for name in part.joint_indices}
        unknown = sorted(set(positions) - set(owners))
        if unknown:
            raise UnknownEntityError("joint", f"{self.name}::{unknown[0]}", list(owners))
        for name, position in positions.items():
            index = owners[name].joint_indices[name]
            self._engine.set_joint_state(owners[name].number, index, position, 0.0)

    def reset_joints(self, positions: dict[str, float]) -> None:
        """Puts joints at positions [rad or m], at rest; joints that are not named go to 0."""
        self.set_joints({name: positions.get(name, 0.0) for part in self.parts for name in part.joint_indices})
        for part in self.parts:
            for index in part.ball_joint_indices:
                self._engine.set_ball_joint_state(part.number, index, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))

    def _centre_state(self) -> tuple[Pose, Twist]:
        """Returns pose and velocity of the root link's centre of mass, in the world frame."""
        centre = self._engine.base_centre(self.number)
        return centre, Twist() if self.static else Twist(*self._engine.base_twist(self.number))


def twist_at(twist: Twist, from_in_world: Pose, to_in_world: Pose) -> Twist:
    """Returns the twist of a rigid body at another of its points."""
    x, y, z = (b - a for a, b in zip(from_in_world.position, to_in_world.position, strict=True))
    return Twist(add(twist.linear, cross(twist.angular, (x, y, z))), twist.angular)


def twist_in_frame(twist: Twist, frame_in_world: Pose) -> Twist:
    """Returns a twist given in the axes of the world in the axes of a frame."""
    world_to_frame = frame_in_world.inverse().quaternion
    return Twist(rotate_vector(world_to_frame, twist.linear), rotate_vector(world_to_frame, twist.angular))
