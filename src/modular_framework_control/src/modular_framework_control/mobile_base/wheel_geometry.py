# SPDX-License-Identifier: BSD-3-Clause
"""Wheel radii and distances between wheels, from the robot description."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_urdf.robot import Cylinder, Joint, Robot, Sphere
from modular_framework_urdf.urdf_reader import AttributeFault, read_urdf
from modular_framework_urdf.xml_text import XmlError

Array = npt.NDArray[np.float64]


class WheelGeometry:
    """Reads the geometry of wheels from `robot_description`.

    Args:
        root_nh: Namespace of `robot_description`.
        parameter: Name of the controller parameter that overrides the description, for error messages.

    Raises:
        ParameterError: The description is missing or not XML.
    """

    def __init__(self, root_nh: NodeHandle, parameter: str) -> None:
        self._where = f"parameter {join_names(root_nh.namespace, 'robot_description')}"
        self._remedy = f"set {parameter} in the controller's parameters, or correct the description"
        description = root_nh.get_param("robot_description")
        if not isinstance(description, str):
            raise ParameterError(
                f"{self._where} is not set, but needed for {parameter}; load the robot "
                f"description, or set {parameter} in the controller's parameters"
            )
        robot = self._read(description)
        self._joints = {joint.name: joint for joint in robot.joints}
        self._links = {link.name: link for link in robot.links}

    def _read(self, description: str) -> Robot:
        try:
            return read_urdf(description, self._where)
        except AttributeFault as fault:
            raise self._error(
                f"<{fault.tag} {fault.key}> of {fault.owner} is '{fault.text}'; expected {fault.expected}"
            ) from fault
        except XmlError as error:
            raise ParameterError(str(error)) from error

    def between(self, first: str, second: str) -> Array:
        """Returns the vector between two joints at position 0, in the frame of the first joint's parent [m].

        Raises:
            ParameterError: A joint is unknown, or the links do not form a tree.
        """
        parent, parent_of_second = (self._frame(self._joint(name).parent) for name in (first, second))
        start = parent @ self._joint(first).origin.matrix()
        end = parent_of_second @ self._joint(second).origin.matrix()
        offset: Array = parent[:3, :3].T @ (end - start)[:3, 3]
        return offset

    def distance(self, first: str, second: str) -> float:
        """Returns the distance between two joints at position 0 [m]; raises as `between`."""
        return float(np.linalg.norm(self.between(first, second)))

    def radius(self, joint: str, shapes: tuple[str, ...] = ("cylinder", "sphere")) -> float:
        """Returns the radius of a joint's wheel [m], as in ros_controllers from the link's first collision geometry.

        Args:
            joint: Name of the joint.
            shapes: Accepted geometry tags.

        Raises:
            ParameterError: The joint is unknown, or the link has no such collision geometry.
        """
        name = self._joint(joint).child
        link = self._links.get(name)
        if link is None:
            raise self._error(
                f"joint '{joint}' has the unknown child link '{name}'; "
                f"links: {', '.join(sorted(self._links)) or 'none'}"
            )
        found = link.collisions[0].shapes if link.collisions else ()
        for shape in found:
            if shape.tag in shapes and isinstance(shape, Cylinder | Sphere):
                return self._checked_radius(shape, name)
        tags = ", ".join(f"<{shape.tag}>" for shape in found) or ("empty" if link.collisions else "none")
        raise self._error(
            f"collision geometry of the wheel link '{name}' is {tags}; expected "
            f"{' or '.join(f'<{tag}>' for tag in shapes)}, whose radius is the wheel's"
        )

    def _joint(self, name: str) -> Joint:
        if name not in self._joints:
            raise self._error(f"unknown joint '{name}'; joints: {', '.join(sorted(self._joints)) or 'none'}")
        return self._joints[name]

    def _checked_radius(self, wheel: Cylinder | Sphere, link: str) -> float:
        if not 0.0 < wheel.radius < math.inf:
            raise self._error(f"<{wheel.tag} radius> of link '{link}' is '{wheel.radius:g}'; expected a number above 0")
        return wheel.radius

    def _error(self, fault: str) -> ParameterError:
        """Returns the error for a fault of the description, with the parameter and the remedy."""
        return ParameterError(f"{self._where}: {fault}; {self._remedy}")

    def _frame(self, link: str) -> Array:
        """Returns the pose of a link in the root link, with all joints at position 0."""
        joints_above = {joint.child: joint for joint in self._joints.values() if joint.child}
        frame = np.eye(4)
        while link in joints_above:
            frame = joints_above[link].origin.matrix() @ frame
            link = joints_above[link].parent
        return frame
