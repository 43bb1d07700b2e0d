# SPDX-License-Identifier: BSD-3-Clause
"""Completes the inertia of robot links that the description leaves out.

Gazebo omits links without inertia, with all links below them, unless a fixed joint connects them to another link. The
physics engines would assume 1 kg for a frame. Therefore, a link with collision shapes gets the mass properties of the
shapes filled with water, SDF's default density; a link without shapes is a frame and gets a negligible mass.

A URDF does not describe the rotors of the drives either. Behind the gear of a gripper, the rotor contributes most of a
finger's inertia. Without a rotor, a motor of 5 N m accelerates a finger of 20 g to 1,000 rad/s within one step, and the
contact with the object would have to absorb this velocity.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_inertial import WATER_KG_PER_M3
from modular_framework_simulation.models.solid_inertia import inertial_of_shapes
from modular_framework_simulation.robots.robot_joint import RobotJoint
from modular_framework_urdf import robot as urdf
from modular_framework_urdf import xml_text
from modular_framework_urdf.mesh_paths import PackageFinder, mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.rotations import Vector3, matrix_from_rpy
from modular_framework_urdf.xml_text import Element

_FRAME_INERTIAL = specs.Inertial(Pose(), 1e-5, (1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-9))
MIN_ACCELERATION_TIME_S = 2e-4
"""Minimum time in which a gripper joint reaches its maximum velocity at full effort; servos take 5 ms or more."""

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def give_masses(root: Element, robot: urdf.Robot, find_package: PackageFinder) -> None:
    """Adds an <inertial> to every link without one.

    Args:
        root: URDF with the meshes of the description; changed in place.
        robot: The same description.
        find_package: Function that finds the packages of package:// URIs.

    Raises:
        DescriptionError: A mesh cannot be read.
    """
    links = {link.name: link for link in robot.links}
    for element in root.findall("link"):
        if element.find("inertial") is None:
            _add_inertial(element, _filled_shapes(links[element.get("name", "")], find_package) or _FRAME_INERTIAL)


def give_rotors(root: Element, joints: Iterable[RobotJoint]) -> None:
    """Raises the moments of inertia of links that a gripper's drive would accelerate too fast for a real drive.

    Args:
        root: URDF whose links have inertias; changed in place.
        joints: Joints of the grippers.
    """
    revolute_joints = {
        item.get("name") for item in root.findall("joint") if item.get("type") in ("revolute", "continuous")
    }
    inertials = {link.get("name"): link.find("inertial") for link in root.findall("link")}
    for joint in joints:
        inertial = inertials[joint.child_link]
        if joint.name in revolute_joints and joint.velocity > 0.0 and inertial is not None:
            missing_moment = joint.effort * MIN_ACCELERATION_TIME_S / joint.velocity - _moment_about(
                joint.axis, inertial
            )
            for key in ("ixx", "iyy", "izz") if missing_moment > 0.0 else ():
                inertia = inertial.find("inertia")
                inertia.set(key, repr(float(inertia.get(key, "0")) + missing_moment))


def _moment_about(axis: Vector3, inertial: Element) -> float:
    """Returns the moment of inertia of a link about an axis through its origin [kg m^2]."""
    origin, inertia = inertial.find("origin"), inertial.find("inertia")
    centre = [float(word) for word in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
    roll, pitch, yaw = (float(word) for word in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split())
    xx, xy, xz, yy, yz, zz = (float(inertia.get(key, "0")) for key in _MOMENTS)
    direction = np.array(axis) / np.linalg.norm(axis)
    axis_in_inertial = direction @ np.array(matrix_from_rpy(roll, pitch, yaw))
    lever = np.cross(direction, centre)
    mass = float(inertial.find("mass").get("value"))
    return float(
        axis_in_inertial @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axis_in_inertial
        + mass * lever @ lever
    )


def _filled_shapes(link: urdf.Link, find_package: PackageFinder) -> specs.Inertial | None:
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
        case specs.Box() | specs.Cylinder() | specs.Sphere():
            return shape
        case urdf.Capsule(radius=radius, length=length):
            return specs.Cylinder(radius, length)
        case urdf.MeshFile(uri=uri, scale=scale):
            try:
                return specs.Mesh(mesh_path(uri, find_package), scale)
            except MeshError as error:
                location = f"robot_description: mesh of link '{link}'"
                raise DescriptionError(location, error.found, error.allowed) from error
    return None  # the engine refuses all other shapes


def _add_inertial(link: Element, inertial: specs.Inertial) -> None:
    element = xml_text.add_child(link, "inertial")
    xml_text.add_child(element, "origin", xyz=" ".join(map(repr, inertial.pose.position)))
    xml_text.add_child(element, "mass", value=repr(inertial.mass))
    moments = map(repr, inertial.inertia)
    xml_text.add_child(element, "inertia", **dict(zip(_MOMENTS, moments, strict=True)))
