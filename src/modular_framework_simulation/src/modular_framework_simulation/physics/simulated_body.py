# SPDX-License-Identifier: BSD-3-Clause
"""Model in the physics engine, with conversions between the engine's centre-of-mass frames and link frames."""

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
    """Linear velocity of a frame's origin [m/s] and angular velocity [rad/s], in the world frame."""

    linear: Vector3 = (0.0, 0.0, 0.0)
    angular: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class BodyState:
    """Pose and twist of a model or link."""

    pose: Pose
    twist: Twist


@dataclass(frozen=True, slots=True)
class JointSettings:
    """Settings of a joint that a request has changed; None for the value of the description.

    Attributes:
        damping: Viscous damping [Nm s/rad or N s/m].
        motor_velocity: Target velocity of the joint motor [rad/s or m/s].
        motor_effort: Maximum effort of the joint motor [Nm or N]; 0 for no motor.
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
        engine: The physics engine.
        number: Body id in the engine.
        name: Name of the model in the world.
        tree: Frames of the links in the engine; None for a robot.
        static: Whether the model never moves.
        spec: Description of the model; None for a robot.

    Attributes:
        further: Other trees of a model whose joints do not connect all links.
    """

    def __init__(
        self,
        engine: PhysicsEngine,
        number: int,
        name: str,
        *,
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
        """Returns all trees of the model, starting with this tree."""
        return (self, *self.further)

    def part_of(self, link: str) -> SimulatedBody:
        """Returns the tree that contains a link of the model; this tree for an unknown link."""
        return next((part for part in self.parts if link in part.link_indices), self)

    def link_name_of(self, number: int, link: int) -> str:
        """Returns the name of a link by body id and link index; "" if unknown."""
        part = next((each for each in self.parts if each.number == number), self)
        return next((name for name, index in part.link_indices.items() if index == link), "")

    def link_names(self) -> list[str]:
        """Returns the names of the links in the description."""
        if self.spec is not None:
            return [link.name for link in self.spec.links]
        return list(self.link_indices)

    def joint_names(self) -> list[str]:
        """Returns the names of the joints in the description; for a robot, only the movable joints."""
        if self.spec is not None:
            return [joint.name for joint in self.spec.joints]
        return list(self.joint_indices)

    def state(self) -> BodyState:
        """Returns pose and twist of the model frame in the world frame."""
        centre_in_world, twist = self._centre_state()
        model_in_world = centre_in_world @ self._root_in_centre @ self._model_in_root
        return BodyState(model_in_world, twist_at(twist, centre_in_world, model_in_world))

    def link_state(self, link: str) -> BodyState:
        """Returns pose and twist of a link frame in the world frame.

        Raises:
            UnknownEntityError: The model does not have the link.
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
        """Moves the model as one rigid body; its joints keep their positions.

        Args:
            state: State of the model frame in the world frame.
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
        """Removes the engine's default motors of ball joints, which would brake the joints."""
        for index in self.ball_joint_indices:
            self._engine.release_ball_joint(self.number, index)

    def place_at_rest(self, pose: Pose) -> None:
        """Places the model at rest, with its trees at the relative poses of the description.

        Args:
            pose: Pose of the model frame in the world frame.
        """
        for part in self.further:
            part.set_state(BodyState(self.state().pose, Twist()))
        self.set_state(BodyState(pose, Twist()))

    def set_joints(self, positions: dict[str, float]) -> None:
        """Sets joint positions [rad or m], at rest; other joints keep their positions.

        Raises:
            UnknownEntityError: The model does not have a movable joint of this name.
        """
        owners = {name: part for part in self.parts for name in part.joint_indices}
        unknown = sorted(set(positions) - set(owners))
        if unknown:
            raise UnknownEntityError("joint", f"{self.name}::{unknown[0]}", list(owners))
        for name, position in positions.items():
            index = owners[name].joint_indices[name]
            self._engine.set_joint_state(owners[name].number, index, position, 0.0)

    def reset_joints(self, positions: dict[str, float]) -> None:
        """Sets joint positions [rad or m], at rest; other joints are set to 0."""
        self.set_joints({name: positions.get(name, 0.0) for part in self.parts for name in part.joint_indices})
        for part in self.parts:
            for index in part.ball_joint_indices:
                self._engine.set_ball_joint_state(part.number, index, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))

    def _centre_state(self) -> tuple[Pose, Twist]:
        """Returns pose and twist of the root link's centre of mass in the world frame."""
        centre = self._engine.base_centre(self.number)
        return centre, Twist() if self.static else Twist(*self._engine.base_twist(self.number))


def twist_at(twist: Twist, from_in_world: Pose, to_in_world: Pose) -> Twist:
    """Returns the twist of a rigid body at another point of the body.

    Args:
        twist: Twist at the first point.
        from_in_world: Frame at the first point.
        to_in_world: Frame at the second point.
    """
    x, y, z = (b - a for a, b in zip(from_in_world.position, to_in_world.position, strict=True))
    return Twist(add(twist.linear, cross(twist.angular, (x, y, z))), twist.angular)


def twist_in_frame(twist: Twist, frame_in_world: Pose) -> Twist:
    """Rotates a twist from the world frame into another frame."""
    world_to_frame = frame_in_world.inverse().quaternion
    return Twist(rotate_vector(world_to_frame, twist.linear), rotate_vector(world_to_frame, twist.angular))
