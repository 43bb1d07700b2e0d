# SPDX-License-Identifier: BSD-3-Clause
"""Computes opening and convex parts of a two-finger gripper per joint position, from the robot description.

The pads are identified by their motion, not by names or the kinematic tree. Among the pairs of facing parts whose gap
changes most over the stroke, the pads are the innermost pair. The innermost parts alone are no criterion: in a four-bar
finger they can be knuckles whose gap hardly changes (Robotiq 2F-85). One of the pads may be fixed to the palm, and the
strokes of the pads may differ; the middle between the pads then depends on the opening.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from modular_framework_core.commander.robot_groups import RobotModelError, read_group
from modular_framework_core.grasp_generation.convex_bodies import (
    ConvexBody,
    ShapeError,
    collision_body,
    max_z_on_lines,
)
from modular_framework_core.grasp_generation.hand_axes import hand_axes
from modular_framework_urdf.mimics import resolve_mimics
from modular_framework_urdf.mirrored_joints import mirror_multiplier
from modular_framework_urdf.planning_groups import KinematicTree
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

Array = npt.NDArray[np.float64]
STROKE_SAMPLES = 200
FULL_STROKE = 0.9  # minimum stroke of the pads, as a fraction of the longest stroke of all pairs
SYMMETRY_M = 1.0e-3  # maximum motion of the middle between the pads of a symmetric hand


class GripperGeometryError(ValueError):
    """The robot description does not describe a two-finger gripper; the text names the missing part."""


@dataclass(frozen=True, slots=True)
class HandPart:
    """Convex part of the hand in the hand frame, at every sampled position of the gripper joint.

    Attributes:
        link: Link of the part.
        corners: Corners, shape (n, k, 3) [m].
        planes: Outward unit normal and offset of each face, shape (n, m, 4); inside, normal . point + offset <= 0.
        is_pad: Whether the part is one of the two pads that touch the object.
    """

    link: str
    corners: Array
    planes: Array
    is_pad: bool = False

    def in_axes(self, axes: Array) -> HandPart:
        """Returns the part in a frame whose axes are the columns of a matrix of shape (3, 3)."""
        planes = np.concatenate([self.planes[:, :, :3] @ axes, self.planes[:, :, 3:]], axis=2)
        return HandPart(self.link, self.corners @ axes, planes, self.is_pad)


@dataclass(frozen=True, slots=True)
class GripperGeometry:
    """Geometry of a gripper as a function of its joint position, in the hand frame.

    The hand frame has the origin of the grasp frame. Its z axis is the approach direction, and the fingers close along
    x.

    Attributes:
        joint: Actuated joint.
        axes: Axes of the hand frame in the grasp frame, as columns, shape (3, 3).
        positions: Joint positions from the lower to the upper limit, shape (n,) [rad or m].
        openings: Free width between the pads, shape (n,) [m].
        pad_centres: Midpoints between the pads, shape (n, 3) [m].
        tips: z of the foremost point of the fingers, shape (n,) [m].
        pad_half_width: Half the width of a pad along y [m].
        pad_half_height: Half the height of a pad along z [m].
        parts: Parts that may collide with an object: fingers, their parent link, and all links fixed to this link.
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
        """Maximum free width between the pads [m]."""
        return float(self.openings.max())

    @property
    def is_symmetric(self) -> bool:
        """Whether both pads move by the same distance."""
        return float(np.ptp(self.pad_centres[:, 0])) < SYMMETRY_M

    @property
    def closed_position(self) -> float:
        """Joint position with the minimum free width [rad or m]."""
        return float(self.positions[int(np.argmin(self.openings))])

    @property
    def max_tip(self) -> float:
        """Maximum z of the fingertips over all joint positions [m]."""
        return float(self.tips.max())

    def position_for(self, opening: float) -> float:
        """Returns the joint position [rad or m] for a free width [m], clamped to the joint limits."""
        order = np.argsort(self.openings)
        return float(np.interp(opening, self.openings[order], self.positions[order]))

    def pad_centre_at(self, opening: float) -> Array:
        """Returns the midpoint between the pads at a free width [m], shape (3,) [m]."""
        order = np.argsort(self.openings)
        widths = self.openings[order]
        return np.array([np.interp(opening, widths, self.pad_centres[order, axis]) for axis in range(3)])

    def object_centre(self, width: float, opening: float) -> Array:
        """Returns the point of the hand at which an object is centred during the approach, shape (3,) [m].

        Both pads have the same distance from the object during the approach, also if only one of them moves. The height
        is that of the pads at contact.

        Args:
            width: Width of the object between the pads [m].
            opening: Free width between the pads during the approach [m].
        """
        return np.array([*self.pad_centre_at(opening)[:2], self.pad_centre_at(width)[2]])

    def lowest_heights(self, openings: Array, top: Array, margin: float, with_pads: bool, floor: float) -> Array:
        """Computes the lowest collision-free heights of the hand over an object.

        A hand that descends along its approach direction also sweeps the volume behind its parts. Therefore the hand
        does not touch a point of the object if, on the vertical line through this point, all parts end above the point.

        Args:
            openings: Free widths between the pads, shape (n,) [m].
            top: Highest points of the object, shape (m, 3) [m]: x along the closing direction and y across, relative
                to the midpoint between the pads; z upwards.
            margin: Clearance around each part [m].
            with_pads: Whether the pads are included; they touch the object at the end of the motion.
            floor: Lower bound of the result [m].

        Returns:
            Minimum z of the grasp frame, shape (n,) [m], at least the floor.
        """
        samples = [int(np.argmin(np.abs(self.openings - opening))) for opening in openings]
        heights = np.full(len(samples), floor)
        for part in self.parts:
            if part.is_pad and not with_pads:
                continue
            near = top[top[:, 2] > floor - float(part.corners[samples, :, 2].max()) - 2 * margin]
            if len(near):
                planes = part.planes[samples]
                planes[:, :, 3] += np.einsum("nmi,ni->nm", planes[:, :, :2], self.pad_centres[samples, :2])
                fronts = max_z_on_lines(planes, near[:, :2], margin)
                heights = np.maximum(heights, (fronts + near[:, 2]).max(axis=1))
        return heights


def driven_joint(urdf: str, srdf: str, hand: str) -> str:
    """Returns the only driven joint of a hand.

    Args:
        urdf: Text of the robot description.
        srdf: Text of the semantic description.
        hand: Planning group of the hand.

    Raises:
        GripperGeometryError: The group does not exist, or has several driven joints or none.
    """
    try:
        joints = read_group(urdf, srdf, hand).joint_names
    except RobotModelError as error:
        raise GripperGeometryError(f"the gripper's joint is not known: {error}") from error
    if len(joints) != 1:
        found = f"{len(joints)} driven joints ({', '.join(joints)})" if joints else "no driven joint"
        raise GripperGeometryError(f"the gripper's joint is not known: the planning group '{hand}' has {found}")
    return joints[0]


def measure_gripper(urdf: str, grasp_link: str, joint: str) -> GripperGeometry:
    """Returns the geometry of a gripper, computed from its collision shapes over the range of its joint.

    Args:
        urdf: Text of the robot description.
        grasp_link: Link whose frame is the grasp frame.
        joint: Actuated joint of the fingers.

    Raises:
        GripperGeometryError: A link or joint is missing, or fewer than two fingers have collision shapes.
    """
    model = _Model(urdf)
    limit = model.joints[joint].limit if joint in model.joints else None
    if limit is None or grasp_link not in model.links:
        raise GripperGeometryError(
            f"the robot description lacks the joint '{joint}' with limits, or the link "
            f"'{grasp_link}'; name the gripper's actuated joint and the grasp frame"
        )
    positions = np.linspace(limit.lower, limit.upper, STROKE_SAMPLES)
    moving = model.moving_links(joint)
    parts = list(_hand_parts(model, grasp_link, joint, positions))
    jaws = _find_jaws(parts, moving)
    axes = _hand_axes(parts, moving, jaws, model.origin_of_fingers(grasp_link, joint))
    parts = [part.in_axes(axes) for part in parts]
    right, left = _pads(parts, moving, jaws)
    gaps = right.corners[:, :, 0].min(axis=1) - left.corners[:, :, 0].max(axis=1)
    if gaps.max() <= 0.0:
        raise GripperGeometryError(
            f"the convex hulls of the links '{right.link}' and '{left.link}' overlap over the whole stroke of the "
            f"joint '{joint}'; split the collision shapes of each jaw into convex elements"
        )
    low = np.maximum(right.corners.min(axis=1), left.corners.min(axis=1))
    high = np.minimum(right.corners.max(axis=1), left.corners.max(axis=1))
    half_open = int(np.argmin(np.abs(gaps - gaps.max() / 2)))
    half = np.maximum(high - low, 0.0)[half_open] / 2
    fingers = [part for part in parts if part.link in moving or part is right or part is left]
    return GripperGeometry(
        joint=joint,
        axes=axes,
        positions=positions,
        openings=np.maximum(gaps, 0.0),
        pad_centres=(low + high) / 2,
        tips=np.max([part.corners[:, :, 2].max(axis=1) for part in fingers], axis=0),
        pad_half_width=float(half[1]),
        pad_half_height=float(half[2]),
        parts=tuple(replace(part, is_pad=part is right or part is left) for part in parts),
    )


@dataclass(frozen=True, slots=True)
class _Jaws:
    """The two parts whose distance changes most; at least one of them moves.

    Attributes:
        first, second: Indices of the parts.
        open_sample: Sample at which the distance is largest.
        closed_sample: Sample at which the distance is smallest.
    """

    first: int
    second: int
    open_sample: int
    closed_sample: int


def _find_jaws(parts: list[HandPart], moving: list[str]) -> _Jaws:
    """Returns the two parts whose distance changes most.

    Args:
        parts: Parts of the hand.
        moving: Finger links.
    """
    is_moving = np.array([part.link in moving for part in parts], dtype=bool)
    if len(parts) < 2 or not is_moving.any():
        raise GripperGeometryError(
            f"the finger links {moving} and their parent link have {len(parts)} collision shapes, of which "
            f"{int(is_moving.sum())} move; give each jaw a collision element"
        )
    centres = np.array([part.corners.mean(axis=1) for part in parts])  # (parts, samples, 3)
    distances = np.linalg.norm(centres[:, None] - centres[None, :], axis=3)
    strokes = np.where(is_moving[:, None] | is_moving[None, :], np.ptp(distances, axis=2), 0.0)
    first, second = (int(index) for index in np.unravel_index(np.argmax(strokes), strokes.shape))
    apart = distances[first, second]
    return _Jaws(first, second, int(np.argmax(apart)), int(np.argmin(apart)))


def _hand_axes(parts: list[HandPart], moving: list[str], jaws: _Jaws, origin: Array) -> Array:
    """Returns the axes of the hand in the grasp frame, from the relative motion of the jaws.

    Args:
        parts: Parts of the hand in the grasp frame.
        moving: Finger links.
        jaws: The two parts whose distance changes most.
        origin: Origin of the parent link of the fingers, shape (3,) [m]; replaces a palm without collision shapes.
    """
    first, second = (parts[index].corners.mean(axis=1) for index in (jaws.first, jaws.second))
    apart = second - first
    palm = [
        part.corners[jaws.open_sample]
        for index, part in enumerate(parts)
        if part.link not in moving and index not in (jaws.first, jaws.second)
    ]
    centre = np.concatenate(palm).mean(axis=0) if palm else origin
    ahead = (first + second)[jaws.open_sample] / 2 - centre
    try:
        return hand_axes(ahead, apart[jaws.open_sample] - apart[jaws.closed_sample])
    except ValueError as error:
        raise GripperGeometryError(
            f"the hand with the finger links {moving} has no closing direction: {error}; name the joint that moves a "
            "jaw"
        ) from error


def _pads(parts: list[HandPart], moving: list[str], jaws: _Jaws) -> tuple[HandPart, HandPart]:
    """Returns the pad on the positive side and the pad on the negative side of the closing direction x."""
    spread = jaws.open_sample
    moving_jaws = sum(parts[index].link in moving for index in (jaws.first, jaws.second))
    middle = sum(parts[index].corners[spread, :, 0].mean() for index in (jaws.first, jaws.second)) / 2
    right = [part for part in parts if part.corners[spread, :, 0].mean() > middle]
    left = [part for part in parts if part.corners[spread, :, 0].mean() <= middle]
    gaps = {
        (one, other): part.corners[:, :, 0].min(axis=1) - partner.corners[:, :, 0].max(axis=1)
        for one, part in enumerate(right)
        for other, partner in enumerate(left)
        if (part.link in moving) + (partner.link in moving) == moving_jaws
        and _face_each_other(part.corners[spread], partner.corners[spread])
    }
    if not gaps:
        raise GripperGeometryError(
            f"no two of the finger links {sorted({part.link for part in parts if part.link in moving})} face each "
            "other across the closing direction, and none faces a link that is fixed to their parent link; give each "
            "jaw a collision element"
        )
    longest = max(np.ptp(gap) for gap in gaps.values())
    chosen = min(
        (pair for pair, gap in gaps.items() if np.ptp(gap) >= FULL_STROKE * longest),
        key=lambda pair: float(np.mean(gaps[pair])),
    )
    return right[chosen[0]], left[chosen[1]]


def _face_each_other(corners: Array, others: Array) -> bool:
    """Returns whether the projections of two parts along the closing direction overlap."""
    low = np.maximum(corners.min(axis=0), others.min(axis=0))
    high = np.minimum(corners.max(axis=0), others.max(axis=0))
    return bool((low[1:] < high[1:]).all())


def _hand_parts(model: _Model, grasp_link: str, joint: str, positions: Array) -> Iterator[HandPart]:
    """Places the collision shapes of the hand in the grasp frame, at every joint position."""
    driven = {name: factor * positions for name, factor in model.driven_joints(joint).items()}
    to_grasp_frame = np.linalg.inv(model.pose(grasp_link, driven))
    for link in model.hand_links(joint):
        transforms = np.broadcast_to(to_grasp_frame @ model.pose(link, driven), (len(positions), 4, 4))
        for body in model.bodies_of(link):
            corners = np.einsum("nij,kj->nki", transforms[:, :3, :3], body.corners) + transforms[:, None, :3, 3]
            normals = np.einsum("nij,kj->nki", transforms[:, :3, :3], body.planes[:, :3])
            offsets = body.planes[:, 3] - np.einsum("nki,ni->nk", normals, transforms[:, :3, 3])
            yield HandPart(link, corners, np.concatenate([normals, offsets[:, :, None]], axis=2))


class _Model:
    """Forward kinematics of a URDF."""

    def __init__(self, urdf: str) -> None:
        try:
            robot = read_urdf(urdf)
        except XmlError as error:
            raise GripperGeometryError(str(error)) from error
        self.links = {link.name: link for link in robot.links}
        self.joints = {joint.name: joint for joint in robot.joints if joint.child}
        self._tree = KinematicTree({name: (joint.parent, joint.child) for name, joint in self.joints.items()})
        self._origins = {name: joint.origin.matrix() for name, joint in self.joints.items()}
        mimics = {name: joint.mimic for name, joint in self.joints.items() if joint.mimic is not None}
        try:
            self._mimics = resolve_mimics(mimics, [joint.name for joint in robot.movable_joints()])
        except ValueError as error:
            raise GripperGeometryError(str(error)) from error

    def driven_joints(self, joint: str) -> dict[str, float]:
        """Returns a joint and its mirrored joints, each with the factor of its position.

        Jaws with a common motor often have no mimic tag (Fetch, WSG 50).
        """
        factors = {name: mirror_multiplier(self.joints[joint], other) for name, other in self.joints.items()}
        return {joint: 1.0} | {name: factor for name, factor in factors.items() if factor}

    def moving_links(self, joint: str) -> list[str]:
        """Returns the links moved by a joint, by its mirrored joints, or by mimic joints of these joints."""
        driven = set(self.driven_joints(joint))
        driven |= {name for name, mimic in self._mimics.items() if mimic.leader in driven}
        return [link for link in self.links if any(name in driven for name, _ in self._tree.up(link))]

    def hand_links(self, joint: str) -> list[str]:
        """Returns the moving links, their parent link, and all links fixed to the parent link."""
        links = {self.joints[joint].parent, *self.moving_links(joint)}
        while True:
            ends = [{other.parent, other.child} for other in self.joints.values() if other.kind == "fixed"]
            more = set().union(*(pair for pair in ends if pair & links)) - links
            if not more:
                return [link for link in self.links if link in links]
            links |= more

    def origin_of_fingers(self, frame: str, joint: str) -> Array:
        """Returns the origin of the parent link of the fingers in the frame of another link, shape (3,) [m]."""
        return (np.linalg.inv(self.pose(frame, {})) @ self.pose(self.joints[joint].parent, {}))[:3, 3]

    def bodies_of(self, link: str) -> Iterator[ConvexBody]:
        """Yields the collision shapes of a link in the link frame."""
        for collision in self.links[link].collisions:
            try:
                yield collision_body(collision).transformed(collision.origin.matrix())
            except ShapeError as error:
                raise GripperGeometryError(f"the collision shape of link '{link}' {error}") from error

    def pose(self, link: str, positions: Mapping[str, Array]) -> Array:
        """Returns the poses of a link in the root link.

        Args:
            link: Link.
            positions: Positions of joints, shape (n,) each [rad or m]; other joints are at 0.

        Returns:
            Transforms, shape (n, 4, 4); shape (4, 4) if none of the joints moves the link.
        """
        transforms = np.eye(4)
        for name, _ in self._tree.up(link):
            transforms = self._origins[name] @ _motion(self.joints[name], self._position(name, positions)) @ transforms
        return transforms

    def _position(self, joint: str, positions: Mapping[str, Array]) -> Array:
        zero = np.array(0.0)
        mimic = self._mimics.get(joint)
        if mimic is None:
            return positions.get(joint, zero)
        return mimic.multiplier * positions.get(mimic.leader, zero) + mimic.offset


def _motion(joint: Joint, positions: Array) -> Array:
    """Returns the transforms of joint positions of shape (...) relative to the joint origin, shape (..., 4, 4)."""
    along = np.multiply.outer(positions, _unit_axis(joint))
    transforms = np.zeros((*along.shape[:-1], 4, 4)) + np.eye(4)
    if joint.kind == "prismatic":
        transforms[..., :3, 3] = along
    elif joint.kind in ("revolute", "continuous"):
        transforms[..., :3, :3] = Rotation.from_rotvec(along).as_matrix()
    return transforms


def _unit_axis(joint: Joint) -> Array:
    """Returns the axis of a joint in the joint frame as a unit vector, shape (3,)."""
    axis = np.array(joint.axis)
    return axis / (np.linalg.norm(axis) or 1.0)
