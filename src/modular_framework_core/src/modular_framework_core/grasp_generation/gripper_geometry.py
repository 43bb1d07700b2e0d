# SPDX-License-Identifier: BSD-3-Clause
"""Computes from the robot description how wide a two-finger gripper opens, and where its parts are then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation.convex_bodies import (
    ConvexBody,
    ShapeError,
    collision_body,
    column_fronts,
)
from modular_framework_core.grasp_generation.hand_axes import hand_axes
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

Array = npt.NDArray[np.float64]
SAMPLES = 200


class GripperGeometryError(ValueError):
    """The robot description does not describe a two-finger gripper; the text says what is missing."""


@dataclass(frozen=True, slots=True)
class HandPart:
    """A convex part of the hand in the frame of the hand, at every sampled position of the gripper's joint.

    Attributes:
        link: Link it belongs to.
        corners: (n, k, 3) corners [m].
        planes: (n, m, 4) outward unit normal and offset of each face; inside, normal . point + offset <= 0.
        is_pad: Whether it is one of the two pads, which are to touch the object.
    """

    link: str
    corners: Array
    planes: Array
    is_pad: bool = False

    def turned(self, axes: Array) -> HandPart:
        """Returns the part in a frame whose axes (3, 3) are given as columns."""
        planes = np.concatenate([self.planes[:, :, :3] @ axes, self.planes[:, :, 3:]], axis=2)
        return HandPart(self.link, self.corners @ axes, planes, self.is_pad)


@dataclass(frozen=True, slots=True)
class GripperGeometry:
    """A gripper as a function of its joint, in the frame of the hand.

    That frame has the origin of the grasp frame; z is the approach, and the fingers close along x.

    Attributes:
        joint: Actuated joint.
        axes: (3, 3) axes of the hand in the grasp frame, as columns.
        positions: (n,) joint positions from the lower to the upper limit [rad or m].
        openings: (n,) free width between the pads [m].
        pad_centres: (n,) z of the pads' centre [m].
        tips: (n,) z of the foremost point of the fingers [m].
        pad_half_width: Half the width of a pad along y [m].
        pad_half_height: Half the height of a pad along z [m].
        parts: Everything an object may run into: the fingers, the link they hang on, and what is fixed to that.
    """

    joint: str
    axes: Array
    positions: Array
    openings: Array
    pad_centres: Array
    tips: Array
    pad_half_width: float
    pad_half_height: float
    parts: tuple[HandPart, ...]

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

    def lowest_heights(self, openings: Array, top: Array, margin: float, with_pads: bool, floor: float) -> Array:
        """Computes how far down the hand can come over an object without touching it.

        A hand that comes down along its approach direction sweeps everything behind its parts too. It is clear of a
        point of the object exactly if, in the column of that point, the foremost point of each part is behind it.

        Args:
            openings: (n,) free widths between the pads [m].
            top: (m, 3) highest points of the object: x along the closing direction and y across, both from the middle
                of the hand, z upwards [m].
            margin: Room to keep around each part [m].
            with_pads: False leaves the pads out, which touch the object in the end.
            floor: Height below which the hand does not come anyway [m].

        Returns:
            (n,) least z of the grasp frame [m], at least the floor.
        """
        samples = [int(np.argmin(np.abs(self.openings - opening))) for opening in openings]
        heights = np.full(len(samples), floor)
        for part in self.parts:
            if part.is_pad and not with_pads:
                continue
            near = top[top[:, 2] > floor - float(part.corners[samples, :, 2].max()) - 2 * margin]
            if len(near):
                fronts = column_fronts(part.planes[samples], near[:, :2], margin)
                heights = np.maximum(heights, (fronts + near[:, 2]).max(axis=1))
        return heights


def measure_gripper(urdf: str, grasp_link: str, joint: str) -> GripperGeometry:
    """Moves the gripper's joint through its range and measures the collision shapes of the hand.

    Args:
        urdf: Text of the robot description.
        grasp_link: Grasp frame.
        joint: Actuated joint of the fingers.

    Returns:
        The gripper's geometry.

    Raises:
        GripperGeometryError: A link or joint is missing, or there are no two fingers with collision shapes.
    """
    model = _Model(urdf)
    limit = model.joints[joint].limit if joint in model.joints else None
    if limit is None or grasp_link not in model.links:
        raise GripperGeometryError(
            f"the robot description lacks the joint '{joint}' with limits, or the link "
            f"'{grasp_link}'; name the gripper's actuated joint and the grasp frame"
        )
    positions = np.linspace(limit.lower, limit.upper, SAMPLES)
    parts = list(_parts(model, grasp_link, joint, positions))
    fingers = model.finger_links(joint)
    axes = _hand_axes(parts, fingers, set(model.moving_links(joint)), model.origin_of_fingers(grasp_link, joint))
    parts = [part.turned(axes) for part in parts]
    measured = [_measure(parts, fingers, grasp_link, sample) for sample in range(SAMPLES)]
    openings = np.array([each.opening for each in measured])
    middle = measured[int(np.argmin(np.abs(openings - openings.max() / 2)))]
    marked = tuple(
        HandPart(part.link, part.corners, part.planes, any(part is pad for pad in middle.pads)) for part in parts
    )
    return GripperGeometry(
        joint,
        axes,
        positions,
        openings,
        np.array([each.pad_centre for each in measured]),
        np.array([each.tip for each in measured]),
        middle.pad_half_width,
        middle.pad_half_height,
        marked,
    )


def _hand_axes(parts: list[HandPart], fingers: list[str], moving: set[str], origin: Array) -> Array:
    """Finds the hand's axes (3, 3) in the grasp frame, with the fingers where they are farthest from each other.

    The palm is where its collision shapes are, or else at the origin (3,) of the link that the fingers hang on.
    """
    centres = {
        link: np.concatenate([part.corners for part in parts if part.link == link], axis=1).mean(axis=1)
        for link in {part.link for part in parts}
    }  # link -> (samples, 3)
    ends = np.array([centres[link] for link in fingers if link in centres])
    palm = [part.corners for part in parts if part.link not in moving]
    if len(ends) < 2:
        raise GripperGeometryError(
            f"fewer than two of the last finger links {fingers} have collision shapes; give each a collision element"
        )
    spread = np.linalg.norm(ends[:, None] - ends[None, :], axis=3).max(axis=(0, 1))
    sample = int(np.argmax(spread))
    try:
        centre = np.concatenate([each[sample] for each in palm]).mean(axis=0) if palm else origin
        return hand_axes(ends[:, sample], centre)
    except ValueError as error:
        raise GripperGeometryError(f"the hand has no closing direction: {error}") from error


def _parts(model: _Model, grasp_link: str, joint: str, positions: Array) -> Iterator[HandPart]:
    """Places the collision shapes of the hand in the grasp frame, at every joint position."""
    for link in model.hand_links(joint):
        transforms = np.array(
            [
                np.linalg.inv(model.pose(grasp_link, {joint: position})) @ model.pose(link, {joint: position})
                for position in positions.tolist()
            ]
        )
        for body in model.bodies_of(link):
            corners = np.einsum("nij,kj->nki", transforms[:, :3, :3], body.corners) + transforms[:, None, :3, 3]
            normals = np.einsum("nij,kj->nki", transforms[:, :3, :3], body.planes[:, :3])
            offsets = body.planes[:, 3] - np.einsum("nki,ni->nk", normals, transforms[:, :3, 3])
            yield HandPart(link, corners, np.concatenate([normals, offsets[:, :, None]], axis=2))


@dataclass(frozen=True, slots=True)
class _Measure:
    """The fingers at one joint position: see GripperGeometry."""

    opening: float
    pad_centre: float
    tip: float
    pad_half_width: float
    pad_half_height: float
    pads: tuple[HandPart, HandPart]


def _measure(parts: list[HandPart], fingers: list[str], grasp_link: str, sample: int) -> _Measure:
    tips = [part for part in parts if part.link in fingers]
    right = [part for part in tips if part.corners[sample, :, 0].mean() > 0]
    left = [part for part in tips if part.corners[sample, :, 0].mean() <= 0]
    if not right or not left:
        raise GripperGeometryError(
            f"the last finger links {fingers} have no collision shapes on both sides of "
            f"'{grasp_link}'; give each a collision element"
        )
    right_pad = min(right, key=lambda part: float(part.corners[sample, :, 0].min()))
    left_pad = max(left, key=lambda part: float(part.corners[sample, :, 0].max()))
    pad = right_pad.corners[sample]
    opening = max(0.0, float(pad[:, 0].min() - left_pad.corners[sample, :, 0].max()))
    low, high = pad.min(axis=0), pad.max(axis=0)
    return _Measure(
        opening,
        float(low[2] + high[2]) / 2,
        max(float(part.corners[sample, :, 2].max()) for part in tips),
        float(high[1] - low[1]) / 2,
        float(high[2] - low[2]) / 2,
        (right_pad, left_pad),
    )


class _Model:
    """Forward kinematics of a URDF, as far as it is needed here."""

    def __init__(self, urdf: str) -> None:
        try:
            robot = read_urdf(urdf)
        except XmlError as error:
            raise GripperGeometryError(str(error)) from error
        self.links = {link.name: link for link in robot.links}
        self.joints = {joint.name: joint for joint in robot.joints if joint.child}
        self.parent_joint = {joint.child: name for name, joint in self.joints.items()}
        self._origins = {name: joint.origin.matrix() for name, joint in self.joints.items()}

    def moving_links(self, joint: str) -> list[str]:
        """Links that move with a joint or with a joint that mimics it."""
        moving: list[str] = []
        for link in self.links:
            name = self.parent_joint.get(link)
            while name is not None:
                mimic = self.joints[name].mimic
                if name == joint or (mimic is not None and mimic.leader == joint):
                    moving.append(link)
                    break
                name = self.parent_joint.get(self.joints[name].parent)
        return moving

    def finger_links(self, joint: str) -> list[str]:
        """Moving links that carry no other moving link."""
        moving = self.moving_links(joint)
        parents = {self.joints[self.parent_joint[link]].parent for link in moving}
        return [link for link in moving if link not in parents]

    def hand_links(self, joint: str) -> list[str]:
        """Moving links, the link they hang on, and every link that is fixed to that."""
        links = {self.joints[joint].parent, *self.moving_links(joint)}
        while True:
            ends = [{other.parent, other.child} for other in self.joints.values() if other.kind == "fixed"]
            more = set().union(*(pair for pair in ends if pair & links)) - links
            if not more:
                return [link for link in self.links if link in links]
            links |= more

    def origin_of_fingers(self, frame: str, joint: str) -> Array:
        """Origin (3,) of the link that the fingers of a joint hang on, in the frame of another link."""
        return (np.linalg.inv(self.pose(frame, {})) @ self.pose(self.joints[joint].parent, {}))[:3, 3]

    def bodies_of(self, link: str) -> Iterator[ConvexBody]:
        """Collision shapes of a link in its own frame."""
        for collision in self.links[link].collisions:
            try:
                yield collision_body(collision).moved(collision.origin.matrix())
            except ShapeError as error:
                raise GripperGeometryError(f"the collision shape of link '{link}' {error}") from error

    def pose(self, link: str, state: dict[str, float]) -> Array:
        """Pose (4, 4) of a link in the root link."""
        transform = np.eye(4)
        name = self.parent_joint.get(link)
        while name is not None:
            joint = self.joints[name]
            transform = self._origins[name] @ _motion(joint, state) @ transform
            name = self.parent_joint.get(joint.parent)
        return transform


def _motion(joint: Joint, state: dict[str, float]) -> Array:
    """Returns the transform of a joint's position relative to its origin (4, 4)."""
    value = state.get(joint.name, 0.0)
    if joint.mimic is not None:
        value = joint.mimic.multiplier * state.get(joint.mimic.leader, 0.0) + joint.mimic.offset
    axis = np.array(joint.axis)
    transform = np.eye(4)
    if joint.kind == "prismatic":
        transform[:3, 3] = axis * value
    elif joint.kind in ("revolute", "continuous"):
        transform[:3, :3] = rotation_about(axis, value)
    return transform


def rotation_about(axis: Array, angle: float) -> Array:
    """Returns the rotation matrix about an axis by an angle [rad]."""
    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
