# SPDX-License-Identifier: BSD-3-Clause
"""Changes of models that requests ask for while the world runs: state and mass of a link, settings of a joint.

What the engine cannot change in a body it gets by a new body in the state of the old one, made from the description
with the change in it.
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

_SAME = 1e-6
"""Relative difference below which a number of a request is the present one: it may have been printed and read."""
_ROUNDING = 1e-9
"""How far a joint may be beyond a limit, or from where it was put [rad or m]."""


@dataclass(frozen=True, slots=True)
class JointChange:
    """New settings of a joint; None leaves one as it is.

    Attributes:
        lower: Lower limit, -inf for none [rad or m].
        upper: Upper limit, inf for none [rad or m].
        settings: Damping and motor.
    """

    lower: float | None
    upper: float | None
    settings: JointSettings


def set_link_state(world: PhysicsWorld, link: PartName, state: BodyState, reference: str) -> None:
    """Puts a link somewhere, and with it the rest of its model, whose joints keep their positions, at rest.

    Args:
        world: The world.
        link: The link.
        state: Of the link, seen from the reference.
        reference: Model, "model::link", or the world.

    Raises:
        UnknownEntityError: The link or the reference does not exist.
        ModelChangeError: The link belongs to the robot.
    """
    body = world.body(link.model)
    _require_model(body, "it stands where its description says; move its joints")
    wanted = world.state_in_world(state, reference)
    body.set_joints(
        {name: measured_joint(world.engine, body, name).position for name in movable_joints(body)}  # at rest
    )
    model_in_world = wanted.pose @ body.link_state(link.part).pose.inverse() @ body.state().pose
    world.set_state(link.model, BodyState(model_in_world, twist_at(wanted.twist, wanted.pose, model_in_world)))


def set_inertial(world: PhysicsWorld, link: PartName, inertial: specs.Inertial, gravity: bool = True) -> bool:
    """Gives a link another mass, centre of mass, inertia and weight; the model goes on moving as it does.

    Args:
        world: The world.
        link: The link.
        inertial: The new values.
        gravity: Whether gravity acts on it.

    Returns:
        Whether they differ from the present ones.

    Raises:
        UnknownEntityError: There is no such link.
        ModelChangeError: The link belongs to the robot or a static model, or no rigid body has such values.
    """
    body = world.body(link.model)
    present = {each: measured_inertial(world.engine, body, each) for each in body.link_names()}
    if _are_same(present[link.part], inertial) and has_weight(body, link.part) == gravity:
        return False
    model = _require_model(body, "its masses are those of its description")
    if body.static:
        raise ModelChangeError(f"model '{link.model}' is static: it has no mass that matters; spawn one that is not")
    _require_rigid(link, inertial)
    links = tuple(
        replace(each, inertial=inertial, gravity=gravity)
        if each.name == link.part
        else replace(each, inertial=present[each.name])
        for each in model.links
    )
    _recreate(world, replace(model, links=links))
    return True


def has_weight(body: SimulatedBody, link: str) -> bool:
    """Returns whether gravity acts on a link."""
    return body.spec is None or all(each.gravity for each in body.spec.links if each.name == link)


def set_joint(world: PhysicsWorld, joint: PartName, change: JointChange) -> None:
    """Changes settings of a joint.

    Raises:
        UnknownEntityError: There is no such joint that moves.
        ModelChangeError: The limits exclude each other, or the joint is one of the robot's, which has limits and
            motors of its own.
    """
    body = world.body(joint.model)
    tree_with_joint(body, joint.part)
    present = measured_joint(world.engine, body, joint.part)
    if change.settings.motor_effort is not None:
        _require_model(body, "its motors belong to the controllers")
    if body.spec is None:
        if change.lower is not None or change.upper is not None:
            _require_model(body, "the limits of its joints are those of its description")
    elif (change.lower, change.upper, change.settings.damping) != (None, None, None):
        lower = present.lower if change.lower is None else change.lower
        upper = present.upper if change.upper is None else change.upper
        if not lower <= upper:
            raise ModelChangeError(f"joint '{joint.scoped}': lower limit {lower:g} is above the upper limit {upper:g}")
        damping = present.damping if change.settings.damping is None else change.settings.damping
        joints = tuple(
            replace(_limited(each, lower, upper), dynamics=replace(each.dynamics, damping=damping))
            if each.name == joint.part
            else each
            for each in body.spec.joints
        )
        _recreate(world, replace(body.spec, joints=joints))
    apply_settings(world.engine, world.body(joint.model), joint.part, change.settings)
    world.rest.disturb()


def set_joint_positions(world: PhysicsWorld, model: str, positions: dict[str, float]) -> None:
    """Puts joints of a model or robot at positions [rad or m], at rest, and sees to it that they are there.

    Raises:
        UnknownEntityError: There is no such model, or it has no such movable joint.
        ModelChangeError: A position is beyond a limit, or a joint is not where it was put.
    """
    body = world.body(model)
    for name, position in positions.items():
        joint = measured_joint(world.engine, body, name)
        if not joint.lower - _ROUNDING <= position <= joint.upper + _ROUNDING:
            allowed = f"allowed is {joint.lower:g} to {joint.upper:g} {_unit(joint)}"
            raise ModelChangeError(f"joint '{model}::{name}': got {position:g}; {allowed}")
    body.set_joints(positions)
    for name, position in positions.items():
        found = measured_joint(world.engine, body, name).position
        if not abs(found - position) <= _ROUNDING + _SAME * abs(position):
            raise ModelChangeError(f"joint '{model}::{name}' was put at {position:g} and is at {found:g}")
    world.note_change()


def _unit(joint: JointMeasurement) -> str:
    return "m" if joint.prismatic else "rad"


def _require_model(body: SimulatedBody, reason: str) -> specs.Model:
    if body.spec is None:
        raise ModelChangeError(f"'{body.name}' is the robot that the controllers drive: {reason}")
    return body.spec


def _are_same(a: specs.Inertial, b: specs.Inertial) -> bool:
    values = [(a.mass, b.mass), *zip(a.inertia, b.inertia, strict=True)]
    largest = max(abs(x) for x in a.inertia)
    alike = all(math.isclose(x, y, rel_tol=_SAME, abs_tol=_SAME * largest) for x, y in values)
    translation, rotation = a.pose.distance_to(b.pose)
    return alike and translation <= _SAME and rotation <= 1e-3


def _require_rigid(link: PartName, inertial: specs.Inertial) -> None:
    """Refuses what no distribution of mass has: the engine would compute nonsense from it."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    if inertial.mass <= 0.0:
        raise ModelChangeError(f"link '{link.scoped}': mass is {inertial.mass:g} kg; allowed is more than 0")
    if min(xx, yy, zz) <= 0.0 or minor <= 0.0 or determinant <= 0.0:
        raise ModelChangeError(
            f"link '{link.scoped}': the inertia {list(inertial.inertia)} is not positive definite; allowed is what "
            "rigid bodies have: read it with get_link_properties, and scale it with the mass"
        )


def _limited(joint: specs.Joint, lower: float, upper: float) -> specs.Joint:
    turns = joint.kind in (specs.JointType.CONTINUOUS, specs.JointType.REVOLUTE)
    return replace(joint, kind=specs.JointType.REVOLUTE if turns else joint.kind, lower=lower, upper=upper)


def _recreate(world: PhysicsWorld, model: specs.Model) -> None:
    settings = dict(world.body(model.name).joint_settings)
    world.replace(model, world.prepare(model))
    for joint, values in settings.items():
        apply_settings(world.engine, world.body(model.name), joint, values)
