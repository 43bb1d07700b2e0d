# SPDX-License-Identifier: BSD-3-Clause
"""Applies changes of models on request at run time: state and mass of a link, settings of a joint.

Properties that the engine cannot change are changed in the description. A new body in the state of the old body then
replaces the old body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from modular_framework_simulation.errors import ModelChangeError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.physics.body_joints import (
    JointMeasurement,
    apply_settings,
    measured_joint,
    movable_joints,
    tree_with_joint,
)
from modular_framework_simulation.physics.body_links import measured_inertial
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import (
    BodyState,
    JointSettings,
    SimulatedBody,
    twist_at,
)

_RELATIVE_TOLERANCE = 1e-6
"""Relative tolerance of equal values, because values of a request may have been printed and parsed."""
_POSITION_TOLERANCE = 1e-9
"""Tolerance of joint positions and limits [rad or m]."""


@dataclass(frozen=True, slots=True)
class JointChange:
    """New settings of a joint; None values are not changed.

    Attributes:
        lower: Lower limit, or -inf [rad or m].
        upper: Upper limit, or inf [rad or m].
        settings: Damping and motor.
    """

    lower: float | None
    upper: float | None
    settings: JointSettings


def set_link_state(world: PhysicsWorld, link: PartName, state: BodyState, reference: str) -> None:
    """Sets the state of a link; its model moves as a rigid body, with its joints at rest.

    Args:
        world: The world.
        link: Name of the link.
        state: State of the link relative to the reference.
        reference: Model, "model::link", or the world.

    Raises:
        UnknownEntityError: The link or the reference does not exist.
        ModelChangeError: The link belongs to the robot.
    """
    body = world.body(link.model)
    _require_model(body, "its base pose is fixed by its description; move its joints instead")
    target = world.state_in_world(state, reference)
    body.set_joints(
        {name: measured_joint(world.engine, body, name).position for name in movable_joints(body)}  # at rest
    )
    model_in_world = target.pose @ body.link_state(link.part).pose.inverse() @ body.state().pose
    world.set_state(link.model, BodyState(model_in_world, twist_at(target.twist, target.pose, model_in_world)))


def set_inertial(world: PhysicsWorld, link: PartName, inertial: specs.Inertial, gravity: bool = True) -> bool:
    """Sets mass, centre of mass, inertia and gravity of a link; the motion of the model continues.

    Args:
        world: The world.
        link: Name of the link.
        inertial: New mass properties.
        gravity: Whether gravity acts on the link.

    Returns:
        Whether the values have changed.

    Raises:
        UnknownEntityError: The link does not exist.
        ModelChangeError: The link belongs to the robot or a static model, or no rigid body has these values.
    """
    body = world.body(link.model)
    current = {each: measured_inertial(world.engine, body, each) for each in body.link_names()}
    if _are_same(current[link.part], inertial) and has_weight(body, link.part) == gravity:
        return False
    model = _require_model(body, "its masses are set by its description")
    if body.static:
        raise ModelChangeError(f"model '{link.model}' is static, so its mass has no effect; spawn a movable model")
    _require_rigid(link, inertial)
    links = tuple(
        replace(each, inertial=inertial, gravity=gravity)
        if each.name == link.part
        else replace(each, inertial=current[each.name])
        for each in model.links
    )
    _recreate(world, replace(model, links=links))
    return True


def has_weight(body: SimulatedBody, link: str) -> bool:
    """Returns whether gravity acts on a link."""
    return body.spec is None or all(each.gravity for each in body.spec.links if each.name == link)


def set_joint(world: PhysicsWorld, joint: PartName, change: JointChange) -> None:
    """Changes settings of a joint.

    Args:
        world: The world.
        joint: Name of the joint.
        change: New settings.

    Raises:
        UnknownEntityError: The joint does not exist or is not movable.
        ModelChangeError: The lower limit is above the upper limit, or the joint belongs to the robot, which has its own
            limits and motors.
    """
    body = world.body(joint.model)
    tree_with_joint(body, joint.part)
    current = measured_joint(world.engine, body, joint.part)
    if change.settings.motor_effort is not None:
        _require_model(body, "its motors belong to the controllers")
    if body.spec is None:
        if change.lower is not None or change.upper is not None:
            _require_model(body, "its joint limits are set by its description")
    elif (change.lower, change.upper, change.settings.damping) != (None, None, None):
        lower = current.lower if change.lower is None else change.lower
        upper = current.upper if change.upper is None else change.upper
        if not lower <= upper:
            raise ModelChangeError(
                f"joint '{joint.scoped_name}': lower limit {lower:g} is above the upper limit {upper:g}"
            )
        damping = current.damping if change.settings.damping is None else change.settings.damping
        joints = tuple(
            replace(_with_joint_limits(each, lower, upper), dynamics=replace(each.dynamics, damping=damping))
            if each.name == joint.part
            else each
            for each in body.spec.joints
        )
        _recreate(world, replace(body.spec, joints=joints))
    apply_settings(world.engine, world.body(joint.model), joint.part, change.settings)
    world.rest.disturb()


def set_joint_positions(world: PhysicsWorld, model: str, positions: dict[str, float]) -> None:
    """Sets joint positions of a model or robot, at rest, and checks the result.

    Args:
        world: The world.
        model: Name of the model or robot.
        positions: Positions by joint name [rad or m].

    Raises:
        UnknownEntityError: The model or a movable joint does not exist.
        ModelChangeError: A position exceeds a limit, or a joint does not keep its position.
    """
    body = world.body(model)
    for name, position in positions.items():
        joint = measured_joint(world.engine, body, name)
        if not joint.lower - _POSITION_TOLERANCE <= position <= joint.upper + _POSITION_TOLERANCE:
            allowed = f"allowed: {joint.lower:g} to {joint.upper:g} {_unit(joint)}"
            raise ModelChangeError(f"joint '{model}::{name}': got {position:g}; {allowed}")
    body.set_joints(positions)
    for name, position in positions.items():
        measured = measured_joint(world.engine, body, name).position
        if not abs(measured - position) <= _POSITION_TOLERANCE + _RELATIVE_TOLERANCE * abs(position):
            raise ModelChangeError(f"joint '{model}::{name}' was set to {position:g}, but is at {measured:g}")
    world.note_change()


def _unit(joint: JointMeasurement) -> str:
    return "m" if joint.prismatic else "rad"


def _require_model(body: SimulatedBody, reason: str) -> specs.Model:
    if body.spec is None:
        raise ModelChangeError(f"'{body.name}' is the controlled robot: {reason}")
    return body.spec


def _are_same(a: specs.Inertial, b: specs.Inertial) -> bool:
    values = [(a.mass, b.mass), *zip(a.inertia, b.inertia, strict=True)]
    max_moment = max(abs(x) for x in a.inertia)
    alike = all(
        math.isclose(x, y, rel_tol=_RELATIVE_TOLERANCE, abs_tol=_RELATIVE_TOLERANCE * max_moment) for x, y in values
    )
    translation, rotation = a.pose.distance_to(b.pose)
    return alike and translation <= _RELATIVE_TOLERANCE and rotation <= 1e-3


def _require_rigid(link: PartName, inertial: specs.Inertial) -> None:
    """Raises ModelChangeError for mass properties that no rigid body has, which the engine cannot simulate."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    if inertial.mass <= 0.0:
        raise ModelChangeError(f"link '{link.scoped_name}': mass is {inertial.mass:g} kg; allowed: more than 0")
    if min(xx, yy, zz) <= 0.0 or minor <= 0.0 or determinant <= 0.0:
        raise ModelChangeError(
            f"link '{link.scoped_name}': the inertia {list(inertial.inertia)} is not positive definite; allowed: an "
            "inertia of a rigid body, for example the result of get_link_properties, scaled with the mass"
        )


def _with_joint_limits(joint: specs.Joint, lower: float, upper: float) -> specs.Joint:
    rotates = joint.kind in (specs.JointType.CONTINUOUS, specs.JointType.REVOLUTE)
    return replace(joint, kind=specs.JointType.REVOLUTE if rotates else joint.kind, lower=lower, upper=upper)


def _recreate(world: PhysicsWorld, model: specs.Model) -> None:
    settings = dict(world.body(model.name).joint_settings)
    world.replace(model, world.prepare(model))
    for joint, values in settings.items():
        apply_settings(world.engine, world.body(model.name), joint, values)
