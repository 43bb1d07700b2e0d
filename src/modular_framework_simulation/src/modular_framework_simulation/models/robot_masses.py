# SPDX-License-Identifier: BSD-3-Clause
"""Gives the links of a robot what the engines need of inertia where the description leaves it out.

Gazebo leaves such links out, with all that hangs on them, unless a fixed joint joins them to another. The engines here
would take 1 kg for a frame. So a link with collision shapes weighs what they weigh filled with water, which is what SDF
takes for a link whose inertia is to be computed; a link without shapes is a frame and weighs next to nothing.

A URDF does not know the rotors of the drives either. Behind the gear of a gripper they are most of what a finger is as
inertia: without them a motor of 5 N m turns a finger of 20 g at 1,000 rad/s after a step, and of that the contact with
the object has to leave nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.robot_joint import RobotJoint, gripper_joints
from modular_framework_simulation.models.sdf_inertial import WATER_KG_PER_M3
from modular_framework_simulation.models.solid_inertia import inertial_of_shapes
from modular_framework_urdf import robot as urdf
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.rotations import Vector3, matrix_from_rpy
from modular_framework_urdf.xml_text import Element

_FRAME = specs.Inertial(Pose(), 1e-5, (1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-9))
SHORTEST_START_S = 2e-4
"""Shortest time in which a gripper's joint reaches its full velocity with its full effort; servos take 5 ms or more."""

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def give_masses(root: Element, robot: urdf.Robot, find_package: PackageFinder) -> None:
    """Adds an <inertial> to every link without one.

    Args:
        root: URDF whose meshes are still those of the description; changed.
        robot: The same description.
        find_package: Looks up the packages of package:// URIs.

    Raises:
        DescriptionError: A mesh cannot be read.
    """
    links = {link.name: link for link in robot.links}
    for element in root.findall("link"):
        if element.find("inertial") is None:
            _add(element, _filled(links[element.get("name", "")], find_package) or _FRAME)


def give_rotors(root: Element, joints: Iterable[RobotJoint]) -> None:
    """Raises the moments of inertia of links that a gripper's drive would accelerate faster than any drive does.

    Args:
        root: URDF whose links have inertias; changed.
        joints: Joints of the robot.
    """
    turning = {item.get("name") for item in root.findall("joint") if item.get("type") in ("revolute", "continuous")}
    inertials = {link.get("name"): link.find("inertial") for link in root.findall("link")}
    for joint in gripper_joints(joints):
        inertial = inertials[joint.child_link]
        if joint.name in turning and joint.velocity > 0.0 and inertial is not None:
            lacking = joint.effort * SHORTEST_START_S / joint.velocity - _moment_about(joint.axis, inertial)
            for key in ("ixx", "iyy", "izz") if lacking > 0.0 else ():
                inertia = inertial.find("inertia")
                inertia.set(key, repr(float(inertia.get(key, "0")) + lacking))


def _moment_about(axis: Vector3, inertial: Element) -> float:
    """Returns the moment of inertia of a link about an axis through its origin [kg m^2]."""
    origin, inertia = inertial.find("origin"), inertial.find("inertia")
    centre = [float(word) for word in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
    roll, pitch, yaw = (float(word) for word in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split())
    xx, xy, xz, yy, yz, zz = (float(inertia.get(key, "0")) for key in _MOMENTS)
    direction = np.array(axis) / np.linalg.norm(axis)
    turned = direction @ np.array(matrix_from_rpy(roll, pitch, yaw))
    lever = np.cross(direction, centre)
    mass = float(inertial.find("mass").get("value"))
    return float(turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned + mass * lever @ lever)


def _filled(link: urdf.Link, find_package: PackageFinder) -> specs.Inertial | None:
    """Returns the mass properties of the collision shapes of a link; None if they have no volume."""
    shapes = []
    for collision in link.collisions:
        pose = Pose.from_xyz_rpy(collision.origin.xyz, collision.origin.rpy)
        for shape in collision.shapes:
            geometry = _geometry(link.name, shape, find_package)
            if geometry is not None:
                shapes.append((specs.Collision("", pose, geometry, specs.Friction()), WATER_KG_PER_M3))
    return inertial_of_shapes(shapes)


def _geometry(link: str, shape: urdf.Shape, find_package: PackageFinder) -> specs.Geometry | None:
    match shape:
        case urdf.Box(size=size):
            return specs.Box(size)
        case urdf.Cylinder(radius=radius, length=length) | urdf.Capsule(radius=radius, length=length):
            return specs.Cylinder(radius, length)
        case urdf.Sphere(radius=radius):
            return specs.Sphere(radius)
        case urdf.MeshFile(uri=uri, scale=scale):
            try:
                return specs.Mesh(mesh_path(uri, find_package), scale)
            except MeshError as error:
                where = f"robot_description: mesh of link '{link}'"
                raise DescriptionError(where, error.found, error.allowed) from error
    return None  # a shape that the engine refuses by itself


def _add(link: Element, inertial: specs.Inertial) -> None:
    element = xml_text.add_child(link, "inertial")
    xml_text.add_child(element, "origin", xyz=" ".join(map(repr, inertial.pose.position)))
    xml_text.add_child(element, "mass", value=repr(inertial.mass))
    moments = map(repr, inertial.inertia)
    xml_text.add_child(element, "inertia", **dict(zip(_MOMENTS, moments, strict=True)))
