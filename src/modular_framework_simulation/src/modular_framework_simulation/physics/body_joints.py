# SPDX-License-Identifier: BSD-3-Clause
"""State and settings of joints in the engine, and efforts on joints."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.physics.physics_engine import JointKind, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import JointSettings, SimulatedBody


@dataclass(frozen=True, slots=True)
class JointMeasurement:
    """State of a movable joint at one instant.

    Attributes:
        position: Position [rad or m].
        velocity: Velocity [rad/s or m/s].
        damping: Viscous damping [Nm s/rad or N s/m].
        lower: Lower limit, or -inf [rad or m].
        upper: Upper limit, or inf [rad or m].
        prismatic: Whether the joint is prismatic.
    """

    position: float
    velocity: float
    damping: float
    lower: float
    upper: float
    prismatic: bool


def tree_with_joint(body: SimulatedBody, joint: str) -> SimulatedBody:
    """Returns the tree of a model that contains a movable joint.

    Raises:
        UnknownEntityError: The model does not have a movable joint of this name.
    """
    for tree in body.parts:
        if joint in tree.joint_indices:
            return tree
    known = [f"{body.name}::{name}" for tree in body.parts for name in tree.joint_indices]
    raise UnknownEntityError("movable joint", f"{body.name}::{joint}", known)


def movable_joints(body: SimulatedBody) -> list[str]:
    """Returns the names of a model's joints that have a position."""
    return [name for tree in body.parts for name in tree.joint_indices]


def measured_joint(engine: PhysicsEngine, body: SimulatedBody, joint: str) -> JointMeasurement:
    """Returns the state of a movable joint.

    Args:
        engine: The physics engine.
        body: The model.
        joint: Name of the joint.

    Raises:
        UnknownEntityError: The model does not have a movable joint of this name.
    """
    tree = tree_with_joint(body, joint)
    index = tree.joint_indices[joint]
    info, (state,) = engine.joints(tree.number)[index], engine.joint_states(tree.number, [index])
    damping = body.joint_settings.get(joint, JointSettings()).damping or 0.0  # the engine does not return it
    if body.spec is not None:
        damping = next(each.dynamics.damping for each in body.spec.joints if each.name == joint)
    prismatic = info.kind is JointKind.PRISMATIC
    return JointMeasurement(state.position, state.velocity, damping, info.lower, info.upper, prismatic)


def apply_effort(engine: PhysicsEngine, body: SimulatedBody, joint: str, effort: float) -> None:
    """Applies an effort to a joint in the next physics step, in addition to the effort of its drive.

    Args:
        engine: The physics engine.
        body: The model.
        joint: Name of the joint.
        effort: Effort [Nm or N].

    Raises:
        UnknownEntityError: The model does not have a movable joint of this name.
    """
    tree = tree_with_joint(body, joint)
    engine.apply_effort(tree.number, tree.joint_indices[joint], effort)


def apply_settings(engine: PhysicsEngine, body: SimulatedBody, joint: str, settings: JointSettings) -> None:
    """Changes settings of a joint, in the engine and in the body.

    Args:
        engine: The physics engine.
        body: The model.
        joint: Name of the joint.
        settings: New settings; None values are not changed.

    Raises:
        UnknownEntityError: The model does not have a movable joint of this name.
    """
    tree = tree_with_joint(body, joint)
    number, index = tree.number, tree.joint_indices[joint]
    if settings.damping is not None and body.spec is None:  # a model's damping is set in its description
        engine.set_joint_damping(number, index, settings.damping)
    previous = body.joint_settings.get(joint, JointSettings())
    merged = JointSettings(
        previous.damping if settings.damping is None else settings.damping,
        previous.motor_velocity if settings.motor_velocity is None else settings.motor_velocity,
        previous.motor_effort if settings.motor_effort is None else settings.motor_effort,
    )
    if merged.motor_effort is not None:
        engine.set_velocity_motor(number, index, merged.motor_velocity or 0.0, merged.motor_effort)
    body.joint_settings[joint] = merged


def copy_joint_motion(engine: PhysicsEngine, source: SimulatedBody, target: SimulatedBody) -> None:
    """Copies positions and velocities of joints to a tree with the same joints.

    A joint beyond a limit of the target is set to the limit, at rest.

    Args:
        engine: The physics engine.
        source: Tree with the original joints.
        target: Tree with the changed joints.
    """
    for joint, index in target.joint_indices.items():
        old, bounds = measured_joint(engine, source, joint), measured_joint(engine, target, joint)
        position = min(max(old.position, bounds.lower), bounds.upper)
        velocity = old.velocity if position == old.position else 0.0
        engine.set_joint_state(target.number, index, position, velocity)
    for index in target.ball_joint_indices:
        engine.set_ball_joint_state(target.number, index, *engine.ball_joint_state(source.number, index))
