# SPDX-License-Identifier: BSD-3-Clause
"""State and settings of a joint as the engine has them, and efforts on it."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.physics.physics_engine import JointKind, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import JointSettings, SimulatedBody


@dataclass(frozen=True, slots=True)
class JointMeasurement:
    """A movable joint at one moment.

    Attributes:
        position: [rad or m]
        velocity: [rad/s or m/s]
        damping: [Nm s/rad or N s/m]
        lower: Lower limit, -inf without [rad or m].
        upper: Upper limit, inf without [rad or m].
        prismatic: Whether it slides instead of turning.
    """

    position: float
    velocity: float
    damping: float
    lower: float
    upper: float
    prismatic: bool


def tree_with_joint(body: SimulatedBody, joint: str) -> SimulatedBody:
    """Returns the tree of a model that a joint belongs to.

    Raises:
        UnknownEntityError: The model has no such joint that moves.
    """
    for tree in body.parts:
        if joint in tree.joint_indices:
            return tree
    known = [f"{body.name}::{name}" for tree in body.parts for name in tree.joint_indices]
    raise UnknownEntityError("joint that moves", f"{body.name}::{joint}", known)


def movable_joints(body: SimulatedBody) -> list[str]:
    """Returns the names of the joints of a model that have a position."""
    return [name for tree in body.parts for name in tree.joint_indices]


def measured_joint(engine: PhysicsEngine, body: SimulatedBody, joint: str) -> JointMeasurement:
    """Returns the state of a joint that moves.

    Raises:
        UnknownEntityError: The model has no such joint.
    """
    tree = tree_with_joint(body, joint)
    index = tree.joint_indices[joint]
    info, (state,) = engine.joints(tree.number)[index], engine.joint_states(tree.number, [index])
    damping = body.joint_settings.get(joint, JointSettings()).damping or 0.0  # the engine has no way to say it
    if body.spec is not None:
        damping = next(each.dynamics.damping for each in body.spec.joints if each.name == joint)
    prismatic = info.kind is JointKind.PRISMATIC
    return JointMeasurement(state.position, state.velocity, damping, info.lower, info.upper, prismatic)


def apply_effort(engine: PhysicsEngine, body: SimulatedBody, joint: str, effort: float) -> None:
    """Lets an effort act on a joint in the coming physics step, besides that of its drive [Nm or N]."""
    tree = tree_with_joint(body, joint)
    engine.apply_effort(tree.number, tree.joint_indices[joint], effort)


def apply_settings(engine: PhysicsEngine, body: SimulatedBody, joint: str, settings: JointSettings) -> None:
    """Changes the settings of a joint, and lets its body remember them.

    Raises:
        UnknownEntityError: The model has no such joint.
    """
    tree = tree_with_joint(body, joint)
    number, index = tree.number, tree.joint_indices[joint]
    if settings.damping is not None and body.spec is None:  # of a model it is in the description
        engine.set_joint_damping(number, index, settings.damping)
    before = body.joint_settings.get(joint, JointSettings())
    merged = JointSettings(
        before.damping if settings.damping is None else settings.damping,
        before.motor_velocity if settings.motor_velocity is None else settings.motor_velocity,
        before.motor_effort if settings.motor_effort is None else settings.motor_effort,
    )
    if merged.motor_effort is not None:
        engine.set_velocity_motor(number, index, merged.motor_velocity or 0.0, merged.motor_effort)
    body.joint_settings[joint] = merged


def copy_joint_motion(engine: PhysicsEngine, source: SimulatedBody, target: SimulatedBody) -> None:
    """Lets the joints of a tree be where those of another tree with the same joints are, and move like them.

    Joints that are then beyond a limit are put there, at rest.
    """
    for joint, index in target.joint_indices.items():
        was, bounds = measured_joint(engine, source, joint), measured_joint(engine, target, joint)
        position = min(max(was.position, bounds.lower), bounds.upper)
        velocity = was.velocity if position == was.position else 0.0
        engine.set_joint_state(target.number, index, position, velocity)
    for index in target.ball_joint_indices:
        engine.set_ball_joint_state(target.number, index, *engine.ball_joint_state(source.number, index))
