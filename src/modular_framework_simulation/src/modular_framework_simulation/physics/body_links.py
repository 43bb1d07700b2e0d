# SPDX-License-Identifier: BSD-3-Clause
"""Mass properties of links in the engine, and forces on links."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Inertial
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, MassProperties, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody, cross
from modular_framework_urdf.rotations import Vector3, rotate_vector


def tree_with_link(body: SimulatedBody, link: str) -> SimulatedBody:
    """Returns the tree of a model that contains a link.

    Raises:
        UnknownEntityError: No tree of the model contains the link; a static model is a single link in the engine.
    """
    tree = body.part_of(link)
    if link not in tree.link_indices:
        known = [name for each in body.parts for name in each.link_indices]
        raise UnknownEntityError("movable link", f"{body.name}::{link}", known)
    return tree


def centre_in_world(engine: PhysicsEngine, body: SimulatedBody, link: str) -> Pose:
    """Returns the pose of a link's centre of mass with its inertia axes, in the world frame.

    Args:
        engine: The physics engine.
        body: The model.
        link: Name of the link.
    """
    tree = tree_with_link(body, link)
    index = tree.link_indices[link]
    if index == BASE_INDEX:
        return engine.base_centre(tree.number)
    return engine.link_motion(tree.number, index).centre


def link_mass(engine: PhysicsEngine, body: SimulatedBody, link: str) -> float:
    """Returns the mass of a link [kg]; 0 for a link that is fixed to the world.

    Args:
        engine: The physics engine.
        body: The model.
        link: Name of the link.
    """
    return _mass_properties(engine, body, link).mass


def _mass_properties(engine: PhysicsEngine, body: SimulatedBody, link: str) -> MassProperties:
    tree = tree_with_link(body, link)
    return engine.mass_properties(tree.number, tree.link_indices[link])


def measured_inertial(engine: PhysicsEngine, body: SimulatedBody, link: str) -> Inertial:
    """Returns mass, centre of mass and inertia of a link, with the inertia axes parallel to the link frame.

    A link that is fixed to the world has no mass in the engine; the values of the description are returned.

    Args:
        engine: The physics engine.
        body: The model.
        link: Name of the link.
    """
    described = None
    if body.spec is not None:
        described = next((each.inertial for each in body.spec.links if each.name == link), None)
    if body.static and body.spec is not None:
        return described or Inertial(Pose(), 1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))  # SDF's defaults
    current = _mass_properties(engine, body, link)
    if current.mass == 0.0 and described is not None:
        return described
    centre = body.link_state(link).pose.inverse() @ centre_in_world(engine, body, link)
    return Inertial(Pose(centre.position), current.mass, _rotated_inertia(current.moments, centre))


def _rotated_inertia(moments: Vector3, axes: Pose) -> tuple[float, float, float, float, float, float]:
    """Rotates a diagonal inertia tensor.

    Args:
        moments: Moments about the axes of the frame [kg m^2].
        axes: Pose of the frame, of which only the rotation is used.

    Returns:
        Elements ixx, ixy, ixz, iyy, iyz, izz of the rotated tensor [kg m^2].
    """
    units = [rotate_vector(axes.quaternion, unit) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]

    def element(row: int, column: int) -> float:
        return sum(moment * unit[row] * unit[column] for moment, unit in zip(moments, units, strict=True))

    return element(0, 0), element(0, 1), element(0, 2), element(1, 1), element(1, 2), element(2, 2)


def apply_wrench(engine: PhysicsEngine, body: SimulatedBody, link: str, force: Vector3, torque: Vector3) -> None:
    """Applies a force and a torque to a link in the next physics step.

    PyBullet's function for torques uses the wrong frame for some links, so the torque is applied as a force couple.

    Args:
        engine: The physics engine.
        body: The model.
        link: Name of the link.
        force: Force at the centre of mass, in the world frame [N].
        torque: Torque in the world frame [Nm].
    """
    tree, centre = tree_with_link(body, link), centre_in_world(engine, body, link).position
    forces: list[tuple[Vector3, Vector3]] = [(centre, force)]
    if torque != (0.0, 0.0, 0.0):
        arm, force_at_arm = couple(torque)
        forces += [
            (_sum(centre, arm, 0.5), force_at_arm),
            (_sum(centre, arm, -0.5), (-force_at_arm[0], -force_at_arm[1], -force_at_arm[2])),
        ]
    for point, partial_force in forces:
        engine.apply_force(tree.number, tree.link_indices[link], partial_force, point)


def couple(torque: Vector3) -> tuple[Vector3, Vector3]:
    """Returns a lever arm of 1 m perpendicular to a torque [Nm], and the force [N] that gives the torque at its end."""
    smallest_axis = min(range(3), key=lambda index: abs(torque[index]))
    across = cross(torque, (float(smallest_axis == 0), float(smallest_axis == 1), float(smallest_axis == 2)))
    length = math.hypot(*across)
    arm = (across[0] / length, across[1] / length, across[2] / length)
    return arm, cross(torque, arm)


def _sum(a: Vector3, b: Vector3, factor: float) -> Vector3:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])
