# SPDX-License-Identifier: BSD-3-Clause
"""State and settings of a joint as the engine has them, and efforts on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
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
    api, tree = engine.api, tree_with_joint(body, joint)
    index = tree.joint_indices[joint]
    info = api.getJointInfo(tree.number, index, physicsClientId=engine.client)
    state = api.getJointState(tree.number, index, physicsClientId=engine.client)
    lower, upper = info[8], info[9]
    if lower > upper:  # the engine's way to say that there are none
        lower, upper = -math.inf, math.inf
    damping = body.joint_settings.get(joint, JointSettings()).damping or 0.0  # the engine has no way to say it
    if body.spec is not None:
        damping = next(each.dynamics.damping for each in body.spec.joints if each.name == joint)
    return JointMeasurement(state[0], state[1], damping, lower, upper, info[2] == api.JOINT_PRISMATIC)


def apply_effort(engine: PhysicsEngine, body: SimulatedBody, joint: str, effort: float) -> None:
    """Lets an effort act on a joint in the coming physics step, besides that of its drive [Nm or N]."""
    tree = tree_with_joint(body, joint)
    engine.api.setJointMotorControl2(
        tree.number,
        tree.joint_indices[joint],
        engine.api.TORQUE_CONTROL,
        force=effort,
        physicsClientId=engine.client,
    )


def apply_settings(engine: PhysicsEngine, body: SimulatedBody, joint: str, settings: JointSettings) -> None:
    """Changes the settings of a joint, and lets its body remember them.

    Raises:
        UnknownEntityError: The model has no such joint.
    """
    tree = tree_with_joint(body, joint)
    number, index = tree.number, tree.joint_indices[joint]
    if settings.damping is not None and body.spec is None:  # of a model it is in the description
        engine.api.changeDynamics(number, index, jointDamping=settings.damping, physicsClientId=engine.client)
    before = body.joint_settings.get(joint, JointSettings())
    merged = JointSettings(
        before.damping if settings.damping is None else settings.damping,
        before.motor_velocity if settings.motor_velocity is None else settings.motor_velocity,
        before.motor_effort if settings.motor_effort is None else settings.motor_effort,
    )
    if merged.motor_effort is not None:
        engine.api.setJointMotorControl2(
            number,
            index,
            engine.api.VELOCITY_CONTROL,
            targetVelocity=merged.motor_velocity or 0.0,
            force=merged.motor_effort,
            physicsClientId=engine.client,
        )
    body.joint_settings[joint] = merged


def copy_joint_motion(engine: PhysicsEngine, source: SimulatedBody, target: SimulatedBody) -> None:
    """Lets the joints of a tree be where those of another tree with the same joints are, and move like them.

    Joints that are then beyond a limit are put there, at rest.
    """
    api, client = engine.api, engine.client
    for joint, index in target.joint_indices.items():
        was, bounds = measured_joint(engine, source, joint), measured_joint(engine, target, joint)
        position = min(max(was.position, bounds.lower), bounds.upper)
        velocity = was.velocity if position == was.position else 0.0
        api.resetJointState(target.number, index, position, velocity, physicsClientId=client)
    for index in target.ball_joint_indices:
        turn, rate = api.getJointStateMultiDof(source.number, index, physicsClientId=client)[:2]
        api.resetJointStateMultiDof(target.number, index, turn, rate, physicsClientId=client)
