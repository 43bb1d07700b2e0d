# SPDX-License-Identifier: BSD-3-Clause
"""Computes from the robot description how wide a two-finger gripper opens, and where its pads and tips are then."""
from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
SAMPLES = 200


class GripperGeometryError(ValueError):
    """The robot description does not describe a two-finger gripper; the text says what is missing."""


@dataclass(frozen=True, slots=True)
class GripperGeometry:
    """A gripper as a function of its joint, in the grasp frame (z = approach, fingers close along x).

    Attributes:
        joint: Actuated joint.
        positions: (n,) joint positions from the lower to the upper limit [rad or m].
        openings: (n,) free width between the pads [m].
        pad_centres: (n,) z of the pads' centre [m].
        tips: (n,) z of the foremost point of the fingers [m].
        pad_half_width: Half the width of a pad along y [m].
        pad_half_height: Half the height of a pad along z [m].
        palm: z of the foremost point of the palm and of the open hand's knuckles; an object must end before it [m].
    """

    joint: str
    positions: Array
    openings: Array
    pad_centres: Array
    tips: Array
    pad_half_width: float
    pad_half_height: float
    palm: float

    @property
    def max_opening(self) -> float:
        """Greatest free width between the pads [m]."""
        return float(self.openings.max())

    @property
    def closed_position(self) -> float:
        """Joint position with the smallest free width [rad or m]."""
        return float(self.positions[int(np.argmin(self.openings))])

    @property
    def max_tip(self) -> float:
        """Foremost z the fingertips ever get to [m]."""
        return float(self.tips.max())

    def position_for(self, opening: float) -> float:
        """Returns the joint position [rad or m] of a free width [m]; widths out of range give the nearest limit."""
        order = np.argsort(self.openings)
        return float(np.interp(opening, self.openings[order], self.positions[order]))

    def pad_centre_at(self, opening: float) -> float:
        """Returns z of the pads' centre [m] at a free width [m]."""
        order = np.argsort(self.openings)
        return float(np.interp(opening, self.openings[order], self.pad_centres[order]))


def measure_gripper(urdf: str, grasp_link: str, joint: str) -> GripperGeometry:
    """Moves the gripper's joint through its range and measures the boxes of the last finger links.

    Args:
        urdf: Text of the robot description.
        grasp_link: Grasp frame.
        joint: Actuated joint of the fingers.

    Returns:
        The gripper's geometry.

    Raises:
        GripperGeometryError: A link or joint is missing, or there are no two fingers with collision boxes.
    """
    model = _Model(urdf)
    element = model.joints.get(joint)
    limit = element.find("limit") if element is not None else None
    if limit is None or grasp_link not in model.links:
        raise GripperGeometryError(f"the robot description lacks the joint '{joint}' with limits, or the link "
                                   f"'{grasp_link}'; name the gripper's actuated joint and the grasp frame")
    fingers = model.finger_links(joint)
    positions = np.linspace(float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0)), SAMPLES)
    measured = [_measure(model, fingers, grasp_link, {joint: float(position)}) for position in positions]
    openings, centres, tips, half_widths, half_heights = (np.array(column) for column in zip(*measured, strict=True))
    middle = int(np.argmin(np.abs(openings - openings.max() / 2)))
    most_open = {joint: float(positions[int(np.argmax(openings))])}
    palm = model.palm_front(joint, grasp_link, most_open)
    return GripperGeometry(joint, positions, openings, centres, tips, float(half_widths[middle]),
                           float(half_heights[middle]), palm)


def _measure(model: _Model, fingers: list[str], grasp_link: str,
             state: dict[str, float]) -> tuple[float, float, float, float, float]:
    boxes = [corners for link in fingers for corners in model.boxes_in(link, grasp_link, state)]
    right = [corners for corners in boxes if corners[:, 0].mean() > 0]
    left = [corners for corners in boxes if corners[:, 0].mean() <= 0]
    if not right or not left:
        raise GripperGeometryError(f"the last finger links {fingers} have no collision boxes on both sides of "
                                   f"'{grasp_link}'")
    right_pad = min(right, key=lambda corners: float(corners[:, 0].min()))
    left_pad = max(left, key=lambda corners: float(corners[:, 0].max()))
    opening = max(0.0, float(right_pad[:, 0].min() - left_pad[:, 0].max()))
    tip = max(float(corners[:, 2].max()) for corners in boxes)
    low, high = right_pad.min(axis=0), right_pad.max(axis=0)
    return opening, float(low[2] + high[2]) / 2, tip, float(high[1] - low[1]) / 2, float(high[2] - low[2]) / 2


class _Model:
    """Forward kinematics of a URDF, as far as it is needed here."""

    def __init__(self, urdf: str) -> None:
        try:
            root = ElementTree.fromstring(urdf)
        except ElementTree.ParseError as error:
            raise GripperGeometryError(f"the robot description is no XML: {error}") from error
        self.links = {link.get("name", ""): link for link in root.findall("link")}
        self.joints = {joint.get("name", ""): joint for joint in root.findall("joint")
                       if joint.find("child") is not None}
        self.parent_joint = {_link(joint, "child"): name for name, joint in self.joints.items()}

    def moving_links(self, joint: str) -> list[str]:
        """Links that move with a joint or with a joint that mimics it."""
        moving: list[str] = []
        for link in self.links:
            name = self.parent_joint.get(link)
            while name is not None:
                mimic = self.joints[name].find("mimic")
                if name == joint or (mimic is not None and mimic.get("joint") == joint):
                    moving.append(link)
                    break
                name = self.parent_joint.get(_link(self.joints[name], "parent"))
        return moving

    def finger_links(self, joint: str) -> list[str]:
        """Moving links that carry no other moving link."""
        moving = self.moving_links(joint)
        parents = {_link(self.joints[self.parent_joint[link]], "parent") for link in moving}
        return [link for link in moving if link not in parents]

    def palm_front(self, joint: str, grasp_link: str, state: dict[str, float]) -> float:
        """Foremost z of the link the fingers hang on and of the links between it and the last ones."""
        last = self.finger_links(joint)
        links = [_link(self.joints[joint], "parent"), *(link for link in self.moving_links(joint) if link not in last)]
        boxes = [corners for link in links for corners in self.boxes_in(link, grasp_link, state)]
        return max((float(corners[:, 2].max()) for corners in boxes), default=-math.inf)

    def boxes_in(self, link: str, frame: str, state: dict[str, float]) -> list[Array]:
        """Corners (8, 3) of the collision boxes of a link, in another link's frame."""
        transform = np.linalg.inv(self.pose(frame, state)) @ self.pose(link, state)
        found = []
        for collision in self.links[link].findall("collision"):
            size = collision.find("geometry/box")
            if size is None:
                continue
            half = np.array([float(value) for value in size.get("size", "0 0 0").split()]) / 2
            corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
            local = transform @ _origin(collision.find("origin"))
            found.append(corners @ local[:3, :3].T + local[:3, 3])
        return found

    def pose(self, link: str, state: dict[str, float]) -> Array:
        """Pose (4, 4) of a link in the root link."""
        transform = np.eye(4)
        name = self.parent_joint.get(link)
        while name is not None:
            joint = self.joints[name]
            transform = _origin(joint.find("origin")) @ self._motion(joint, state) @ transform
            name = self.parent_joint.get(_link(joint, "parent"))
        return transform

    def _motion(self, joint: ElementTree.Element, state: dict[str, float]) -> Array:
        kind, mimic = joint.get("type"), joint.find("mimic")
        value = state.get(joint.get("name", ""), 0.0)
        if mimic is not None:
            value = float(mimic.get("multiplier", 1.0)) * state.get(mimic.get("joint", ""), 0.0) + float(
                mimic.get("offset", 0.0))
        element = joint.find("axis")
        axis = np.array([float(v) for v in (element.get("xyz", "1 0 0") if element is not None else "1 0 0").split()])
        transform = np.eye(4)
        if kind == "prismatic":
            transform[:3, 3] = axis * value
        elif kind in ("revolute", "continuous"):
            transform[:3, :3] = rotation_about(axis, value)
        return transform


def rotation_about(axis: Array, angle: float) -> Array:
    """Returns the rotation matrix about an axis by an angle [rad] (Rodrigues' formula)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def _origin(element: ElementTree.Element | None) -> Array:
    transform = np.eye(4)
    if element is not None:
        roll, pitch, yaw = (float(value) for value in element.get("rpy", "0 0 0").split())
        transform[:3, :3] = (rotation_about(np.array([0.0, 0.0, 1.0]), yaw) @
                             rotation_about(np.array([0.0, 1.0, 0.0]), pitch) @
                             rotation_about(np.array([1.0, 0.0, 0.0]), roll))
        transform[:3, 3] = [float(value) for value in element.get("xyz", "0 0 0").split()]
    return transform


def _link(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return element.get("link", "") if element is not None else ""
