# SPDX-License-Identifier: BSD-3-Clause
"""Mass of a link as the engine has it, and forces on it."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Inertial
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, MassProperties, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody, cross
from modular_framework_urdf.rotations import Vector3, rotate_vector


def tree_with_link(body: SimulatedBody, link: str) -> SimulatedBody:
    """Returns the tree of a model that a link belongs to.

    Raises:
        UnknownEntityError: The model has no such link of its own; a static model is one link for the engine.
    """
    tree = body.part_of(link)
    if link not in tree.link_indices:
        known = [name for each in body.parts for name in each.link_indices]
        raise UnknownEntityError("link that moves", f"{body.name}::{link}", known)
    return tree


def centre_in_world(engine: PhysicsEngine, body: SimulatedBody, link: str) -> Pose:
    """Returns the centre of mass of a link with its axes of inertia, in the world frame."""
    tree = tree_with_link(body, link)
    index = tree.link_indices[link]
    if index == BASE_INDEX:
        return engine.base_centre(tree.number)
    return engine.link_motion(tree.number, index).centre


def link_mass(engine: PhysicsEngine, body: SimulatedBody, link: str) -> float:
    """Returns the mass of a link [kg]; the engine has 0 for one that is fastened to the world."""
    return _mass_properties(engine, body, link).mass


def _mass_properties(engine: PhysicsEngine, body: SimulatedBody, link: str) -> MassProperties:
    tree = tree_with_link(body, link)
    return engine.mass_properties(tree.number, tree.link_indices[link])


def measured_inertial(engine: PhysicsEngine, body: SimulatedBody, link: str) -> Inertial:
    """Returns mass, centre of mass and inertia of a link; the axes of the inertia are those of the link frame.

    What is fastened to the world has no mass in the engine: there the description decides.
    """
    described = None
    if body.spec is not None:
        described = next((each.inertial for each in body.spec.links if each.name == link), None)
    if body.static and body.spec is not None:
        return described or Inertial(Pose(), 1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))  # SDF's defaults
    present = _mass_properties(engine, body, link)
    if present.mass == 0.0 and described is not None:
        return described
    centre = body.link_state(link).pose.inverse() @ centre_in_world(engine, body, link)
    return Inertial(Pose(centre.position), present.mass, _rotated(present.moments, centre))


def _rotated(moments: Vector3, axes: Pose) -> tuple[float, float, float, float, float, float]:
    """Returns ixx, ixy, ixz, iyy, iyz, izz of principal moments about the axes of a frame."""
    units = [rotate_vector(axes.quaternion, unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]

    def element(row: int, column: int) -> float:
        return sum(moment * unit[row] * unit[column] for moment, unit in zip(moments, units, strict=True))

    return element(0, 0), element(0, 1), element(0, 2), element(1, 1), element(1, 2), element(2, 2)


def apply_wrench(engine: PhysicsEngine, body: SimulatedBody, link: str, force: Vector3, torque: Vector3) -> None:
    """Lets a force and a torque act on a link in the coming physics step.

    PyBullet's function for torques mistakes the frame of some links, so a torque is applied as two forces.

    Args:
        engine: Where the body lives.
        body: The model.
        link: Its link.
        force: At the centre of mass, in the world frame [N].
        torque: In the world frame [Nm].
    """
    tree, centre = tree_with_link(body, link), centre_in_world(engine, body, link).position
    parts: list[tuple[Vector3, Vector3]] = [(centre, force)]
    if torque != (0.0, 0.0, 0.0):
        arm, pull = couple(torque)
        parts += [(_sum(centre, arm, 0.5), pull), (_sum(centre, arm, -0.5), (-pull[0], -pull[1], -pull[2]))]
    for point, push in parts:
        engine.apply_force(tree.number, tree.link_indices[link], push, point)


def couple(torque: Vector3) -> tuple[Vector3, Vector3]:
    """Returns an arm of 1 m across a torque [Nm], and the force [N] that has this torque at its end."""
    flattest = min(range(3), key=lambda index: abs(torque[index]))
    across = cross(torque, (float(flattest == 0), float(flattest == 1), float(flattest == 2)))
    length = math.hypot(*across)
    arm = (across[0] / length, across[1] / length, across[2] / length)
    return arm, cross(torque, arm)


def _sum(a: Vector3, b: Vector3, factor: float) -> Vector3:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])
