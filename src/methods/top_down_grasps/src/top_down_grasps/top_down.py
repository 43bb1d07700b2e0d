# SPDX-License-Identifier: BSD-3-Clause
"""Generates and ranks top-down grasps of an object with a two-finger gripper.

The hand points straight down. For several closing directions and positions along the object, the part of the object
between the pads must fit the opening with clearance, its sides must face the pads, and the fingertips must stay above
the support. No other part of the hand may touch the object during descent or closing; if it does, the hand opens wider
or stays higher. The remaining grasps are ranked by the alignment of the sides with the pads, the distance from the
centre of mass, the clearance, the pad overlap, and the convenience of the position for the arm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_clearance import (
    CONTACT_DEPTH_M,
    HEIGHT_ROUNDS,
    HEIGHT_TOLERANCE_M,
    highest_points,
    lowest_height,
    passage_between,
)
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.surface_points import Surface

Array = npt.NDArray[np.float64]

SAME_DIRECTION_RAD = math.radians(3.0)


@dataclass(frozen=True, slots=True)
class TopDownSettings(HandMotionSettings):
    """Feasibility limits of a grasp.

    Attributes:
        min_side_alignment: Minimum cosine between a side's normal and the closing direction.
        yaw_step_rad: Step between closing directions [rad].
        position_step_m: Step between positions along the object [m].
        best_reach_m: Preferred horizontal distance from the arm's base [m].
        base_xy_m: Position (x, y) of the arm's base in the world [m].
    """

    min_side_alignment: float = 0.95
    yaw_step_rad: float = math.pi / 12
    position_step_m: float = 0.015
    best_reach_m: float = 0.5
    base_xy_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class TopDownGrasp:
    """A top-down grasp.

    Attributes:
        position: Position (x, y, z) of the grasp frame in the world [m].
        yaw: Closing direction as an angle about world z [rad].
        width: Width of the object between the pads [m].
        pregrasp_joint: Gripper joint position during descent [rad or m].
        quality: Quality in [0, 1]; larger is better.
    """

    position: tuple[float, float, float]
    yaw: float
    width: float
    pregrasp_joint: float
    quality: float

    @property
    def quaternion_xyzw(self) -> tuple[float, float, float, float]:
        """Orientation of the hand in the world: z down, x along the closing direction."""
        return (math.cos(self.yaw / 2), math.sin(self.yaw / 2), 0.0, 0.0)


def top_down_grasps(
    surface: Surface, support_z: float, gripper: GripperGeometry, settings: TopDownSettings
) -> list[TopDownGrasp]:
    """Returns the grasps of an object.

    Args:
        surface: Surface of the object in the world frame.
        support_z: Height of the object's support [m].
        gripper: Geometry of the hand.
        settings: Feasibility limits.

    Returns:
        Feasible grasps, best first; empty if the object cannot be grasped from above.
    """
    grasps = []
    top = highest_points(surface.points)
    for yaw in _directions(surface, settings.yaw_step_rad):
        flat = _Slice.along(yaw, surface, top)
        for y_grasp in _grasp_positions(flat.y, flat.centroid[1], settings.position_step_m):
            grasp = _grasp_at(flat, y_grasp, support_z, gripper, settings)
            if grasp is not None:
                grasps.append(grasp)
    return sorted(grasps, key=lambda grasp: -grasp.quality)


@dataclass(frozen=True, slots=True)
class _Slice:
    """Surface points in the axes of the hand: x closing, y across, z up.

    Attributes:
        yaw: Closing direction as an angle about world z [rad].
        facing: Component of each normal along x.
        top: Highest points, shape (n, 3).
        centroid: Centre of mass of the object (x, y, z).
    """

    yaw: float
    x: Array
    y: Array
    z: Array
    facing: Array
    top: Array
    centroid: tuple[float, float, float]

    @classmethod
    def along(cls, yaw: float, surface: Surface, top: Array) -> _Slice:
        """Rotates the surface and its highest points (n, 3) into the axes of a closing direction."""
        closing = np.array([math.cos(yaw), math.sin(yaw)])
        across = np.array([math.sin(yaw), -math.cos(yaw)])
        x, y = surface.points[:, :2] @ closing, surface.points[:, :2] @ across
        centroid = float(surface.centroid[:2] @ closing), float(surface.centroid[:2] @ across)
        return cls(
            yaw=yaw,
            x=x,
            y=y,
            z=surface.points[:, 2],
            facing=surface.normals[:, :2] @ closing,
            top=np.column_stack([top[:, :2] @ closing, top[:, :2] @ across, top[:, 2]]),
            centroid=(*centroid, float(surface.centroid[2])),
        )

    def in_world(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Returns a point of these axes in the world."""
        return x * math.cos(self.yaw) + y * math.sin(self.yaw), x * math.sin(self.yaw) - y * math.cos(self.yaw), z

    def top_around(self, x: float, y: float) -> Array:
        """Returns the highest points relative to a point in the plane."""
        return self.top - [x, y, 0.0]


def _directions(surface: Surface, step: float) -> list[float]:
    """Returns closing directions within a range of pi: the object's sides first, then regular steps."""
    sides = [math.atan2(axis[1], axis[0]) % math.pi for axis in surface.axes if math.hypot(axis[0], axis[1]) > 0.9]
    fan = [index * step for index in range(max(1, round(math.pi / step)))]
    chosen: list[float] = []
    for yaw in [*sides, *fan]:
        gaps = [abs((yaw - other + math.pi / 2) % math.pi - math.pi / 2) for other in chosen]
        if all(gap > SAME_DIRECTION_RAD for gap in gaps):
            chosen.append(yaw)
    return chosen


def _grasp_positions(y: Array, centre: float, step: float) -> Iterable[float]:
    """Yields positions along the object [m]: its centre of mass, then alternately towards both ends."""
    yield centre
    for index in range(1, 1 + int(max(y.max() - centre, centre - y.min()) / step)):
        for y_grasp in (centre + index * step, centre - index * step):
            if y.min() < y_grasp < y.max():
                yield y_grasp


def _grasp_at(
    flat: _Slice, y_grasp: float, support_z: float, gripper: GripperGeometry, settings: TopDownSettings
) -> TopDownGrasp | None:
    hold = _highest_hold(flat, y_grasp, support_z, gripper, settings)
    if hold is None:
        return None
    alignment = min(
        _alignment(flat, hold.touching & (flat.x <= hold.low + CONTACT_DEPTH_M), -1.0),
        _alignment(flat, hold.touching & (flat.x >= hold.high - CONTACT_DEPTH_M), 1.0),
    )
    if alignment < settings.min_side_alignment:
        return None
    middle = (hold.low + hold.high) / 2
    pads = gripper.pad_centre_at(hold.opening)
    position = flat.in_world(middle - pads[0], y_grasp - pads[1], hold.z)
    quality = _quality(
        alignment=alignment,
        offset_m=math.dist((middle, y_grasp, hold.pad_z), flat.centroid),
        clearance=(gripper.max_opening - hold.opening) / gripper.max_opening,
        overlap=hold.overlap / (2 * gripper.pad_half_height),
        position=position,
        settings=settings,
    )
    return TopDownGrasp(position, flat.yaw, hold.high - hold.low, gripper.position_for(hold.opening), quality)


@dataclass(frozen=True, slots=True)
class _Hold:
    """Pose and contact of the hand at a position along the object.

    Attributes:
        z: Height of the grasp frame [m].
        pad_z: Height of the pads' centre at contact [m].
        low, high: Positions of the contacts along the closing direction [m].
        overlap: Height of the contact between pads and object [m].
        opening: Free width between the pads during descent [m].
        touching: Whether each point is between the pads.
    """

    z: float
    pad_z: float
    low: float
    high: float
    overlap: float
    opening: float
    touching: npt.NDArray[np.bool_]


def _highest_hold(
    flat: _Slice, y_grasp: float, support_z: float, gripper: GripperGeometry, settings: TopDownSettings
) -> _Hold | None:
    """Raises the hand from the height of the centre of mass until it is clear of the object.

    The required opening depends on the height and vice versa; since the hand only moves up, a few iterations converge.
    """
    between = np.abs(flat.y - y_grasp) <= gripper.pad_half_width
    if not between.any():
        return None
    pad_offset = float(gripper.pad_centre_at(min(float(np.ptp(flat.x[between])), gripper.max_opening))[2])
    top = float(flat.z[np.abs(flat.y - y_grasp) <= gripper.pad_half_width + 0.01].max())
    z = max(
        min(flat.centroid[2], top - gripper.pad_half_height / 2) + pad_offset,
        support_z + gripper.max_tip + settings.tip_clearance_m,
    )
    for _ in range(HEIGHT_ROUNDS):
        pad_z = z - pad_offset
        touching = between & (np.abs(flat.z - pad_z) <= gripper.pad_half_height)
        overlap = min(top, pad_z + gripper.pad_half_height) - (pad_z - gripper.pad_half_height)
        if overlap < settings.min_pad_overlap_m or not touching.any():
            return None
        straddled = between & (flat.z >= z - gripper.max_tip)
        passage = passage_between(flat.x[touching], flat.x[straddled], gripper, settings)
        if passage is None:
            return None
        lowest, opening = lowest_height(flat.top_around(passage.middle, y_grasp), passage, z, gripper)
        if lowest <= z + HEIGHT_TOLERANCE_M:
            low, high = float(flat.x[touching].min()), float(flat.x[touching].max())
            return _Hold(z, pad_z, low, high, overlap=overlap, opening=opening, touching=touching)
        z = lowest
    return None


def _alignment(flat: _Slice, side: npt.NDArray[np.bool_], sign: float) -> float:
    """Returns the mean cosine between the pad's normal and the surface at the outermost points that face the pad."""
    facing = sign * flat.facing[side]
    facing = facing[facing > 0.3]
    return float(facing.mean()) if facing.size else 0.0


def _quality(
    *,
    alignment: float,
    offset_m: float,
    clearance: float,
    overlap: float,
    position: tuple[float, float, float],
    settings: TopDownSettings,
) -> float:
    reach = math.dist(position[:2], settings.base_xy_m)
    reach_score = 1.0 - min(1.0, abs(reach - settings.best_reach_m) / 0.5)
    centred = 1.0 - min(1.0, offset_m / 0.06)
    squareness = (alignment - settings.min_side_alignment) / (1.0 - settings.min_side_alignment)
    return 0.3 * squareness + 0.3 * centred + 0.15 * clearance + 0.1 * min(1.0, overlap) + 0.15 * reach_score
