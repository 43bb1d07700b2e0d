# SPDX-License-Identifier: BSD-3-Clause
"""Radius of wheels and distances between them, from the robot description."""
from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import numpy.typing as npt

from modular_framework_control.hardware_interface.urdf_xml import parse_description
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names

Array = npt.NDArray[np.float64]


class WheelGeometry:
    """What `robot_description` says of the joints of wheels.

    Args:
        root_nh: where `robot_description` is found.
        wanted_for: the parameter that would make the description unnecessary, for messages.

    Raises:
        ParameterError: there is no description, or it is not XML.
    """

    def __init__(self, root_nh: NodeHandle, wanted_for: str) -> None:
        self._where = f"parameter {join_names(root_nh.namespace, 'robot_description')}"
        self._remedy = f"set {wanted_for} in the controller's parameters, or correct the description"
        description = root_nh.get_param("robot_description")
        if not isinstance(description, str):
            raise ParameterError(f"{self._where} is not set, and {wanted_for} is looked up there; load the robot "
                                 f"description, or set {wanted_for} in the controller's parameters")
        root = parse_description(description, self._where)
        self._joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
        self._links = {link.get("name", ""): link for link in root.findall("link")}

    def between(self, first: str, second: str) -> Array:
        """Way from the first joint to the second, both unmoved: x, y, z in the frame of the first one's parent [m].

        Raises:
            ParameterError: no such joint, an origin that is not made of numbers, or links that are no tree.
        """
        parent, parent_of_second = (self._frame(self._end(self._joint(name), "parent")) for name in (first, second))
        start = parent @ self._placement(self._joint(first))
        end = parent_of_second @ self._placement(self._joint(second))
        way: Array = parent[:3, :3].T @ (end - start)[:3, 3]
        return way

    def distance(self, first: str, second: str) -> float:
        """Distance between two joints, both unmoved [m]; raises as `between`."""
        return float(np.linalg.norm(self.between(first, second)))

    def radius(self, joint: str, shapes: tuple[str, ...] = ("cylinder", "sphere")) -> float:
        """Radius of the wheel that a joint turns: that of its link's collision geometry [m].

        Args:
            joint: name of the joint.
            shapes: geometries that are wheels.

        Raises:
            ParameterError: no such joint, or its link has no such collision geometry.
        """
        name = self._end(self._joint(joint), "child")
        link = self._links.get(name)
        if link is None:
            raise ParameterError(f"{self._where}: joint '{joint}' has the child link '{name}', which is not there; "
                                 f"links: {', '.join(sorted(self._links)) or 'none'}; {self._remedy}")
        geometry = link.find("collision/geometry")
        for shape in () if geometry is None else geometry:
            if shape.tag in shapes:
                return self._radius_of(shape, name)
        found = "none" if geometry is None else ", ".join(f"<{shape.tag}>" for shape in geometry) or "empty"
        raise ParameterError(f"{self._where}: collision geometry of the wheel link '{name}' is {found}; expected "
                             f"{' or '.join(f'<{tag}>' for tag in shapes)}, whose radius is the wheel's; "
                             f"{self._remedy}")

    def _joint(self, name: str) -> ElementTree.Element:
        if name not in self._joints:
            raise ParameterError(f"{self._where}: there is no joint '{name}'; joints: "
                                 f"{', '.join(sorted(self._joints)) or 'none'}; {self._remedy}")
        return self._joints[name]

    def _radius_of(self, shape: ElementTree.Element, link: str) -> float:
        text = shape.get("radius", "")
        try:
            radius = float(text)
        except ValueError:
            radius = math.nan
        if not 0.0 < radius < math.inf:
            raise ParameterError(f"{self._where}: <{shape.tag} radius> of link '{link}' is '{text}'; expected a number "
                                 f"above 0; {self._remedy}")
        return radius

    def _frame(self, link: str) -> Array:
        """Frame of a link in the root link, all joints unmoved."""
        frame = np.eye(4)
        above = link
        for _ in range(len(self._joints) + 1):
            carrier = next((joint for joint in self._joints.values() if self._end(joint, "child") == above), None)
            if carrier is None:
                return frame
            frame = self._placement(carrier) @ frame
            above = self._end(carrier, "parent")
        raise ParameterError(f"{self._where}: the way from link '{link}' to the root link never ends; expected a tree "
                             f"of links; {self._remedy}")

    def _placement(self, joint: ElementTree.Element) -> Array:
        """Frame of an unmoved joint in its parent link."""
        frame = np.eye(4)
        origin = joint.find("origin")
        if origin is not None:
            name = joint.get("name", "")
            frame[:3, 3] = self._numbers(origin.get("xyz", ""), f"<origin xyz> of joint '{name}'")
            frame[:3, :3] = _rotation(*self._numbers(origin.get("rpy", ""), f"<origin rpy> of joint '{name}'"))
        return frame

    @staticmethod
    def _end(joint: ElementTree.Element, which: str) -> str:
        element = joint.find(which)
        return "" if element is None else element.get("link", "")

    def _numbers(self, text: str, what: str) -> tuple[float, float, float]:
        try:
            x, y, z = (float(part) for part in (text or "0 0 0").split())
        except ValueError:
            x = y = z = math.nan
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            raise ParameterError(f"{self._where}: {what} is '{text}'; expected three numbers; {self._remedy}")
        return x, y, z


def _rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix of a URDF's rpy: about the fixed axes x, y, z in this order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])
