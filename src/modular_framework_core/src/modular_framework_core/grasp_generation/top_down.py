# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ranks ways to grasp an object from above with a two-finger gripper.

The hand points straight down. For several closing directions and places along the object, the part of the object
between the pads is measured: it must fit the opening with room to spare, its sides must face the pads, and the
fingertips must stay above the support. What remains is ranked by how squarely the sides face the pads, how near the
grasp is to the centre of mass, how much room there is, how much of the pads touches, and how comfortable the place is
for the arm.
"""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.surface_points import Surface

Array = npt.NDArray[np.float64]

CONTACT_DEPTH_M = 0.001
SAME_DIRECTION_RAD = math.radians(3.0)


@dataclass(frozen=True, slots=True)
class TopDownSettings:
    """What counts as a usable grasp.

    Attributes:
        approach_distance_m: Height of the pregrasp pose over the grasp pose [m].
        lift_distance_m: Height of the postgrasp pose over the grasp pose [m].
        finger_clearance_m: Room between a pad and the object on each side when the hand comes down [m].
        tip_clearance_m: Smallest distance of the fingertips from the support [m].
        min_pad_overlap_m: Least height of the pads that must touch [m].
        min_side_alignment: Least cosine between a side's normal and the closing direction.
        yaw_step_rad: Step between closing directions [rad].
        place_step_m: Step between places along the object [m].
        best_reach_m: Horizontal distance from the arm's base at which it works best [m].
        base_xy_m: Place of the arm's base in the world [m].
    """

    approach_distance_m: float = 0.10
    lift_distance_m: float = 0.15
    finger_clearance_m: float = 0.012
    tip_clearance_m: float = 0.006
    min_pad_overlap_m: float = 0.008
    min_side_alignment: float = 0.95
    yaw_step_rad: float = math.pi / 12
    place_step_m: float = 0.015
    best_reach_m: float = 0.5
    base_xy_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class TopDownGrasp:
    """One way to grasp.

    Attributes:
        position: (x, y, z) of the grasp frame in the world [m].
        yaw: Closing direction as an angle about world z [rad].
        width: Width of the object between the pads [m].
        pregrasp_joint: Gripper joint position with which to come down [rad or m].
        quality: Rank in [0, 1]; more is better.
    """

    position: tuple[float, float, float]
    yaw: float
    width: float
    pregrasp_joint: float
    quality: float

    @property
    def quaternion_xyzw(self) -> tuple[float, float, float, float]:
        """Orientation of the grasp frame in the world: z down, x along the closing direction."""
        return (math.cos(self.yaw / 2), math.sin(self.yaw / 2), 0.0, 0.0)


def top_down_grasps(surface: Surface, support_z: float, gripper: GripperGeometry,
                    settings: TopDownSettings) -> list[TopDownGrasp]:
    """Finds the grasps of an object.

    Args:
        surface: Surface of the object in the world frame.
        support_z: Height of what the object stands on [m].
        gripper: Geometry of the hand.
        settings: What counts as usable.

    Returns:
        Usable grasps, best first; empty when the object cannot be grasped from above.
    """
    grasps = []
    for yaw in _directions(surface, settings.yaw_step_rad):
        closing = np.array([math.cos(yaw), math.sin(yaw)])
        across = np.array([math.sin(yaw), -math.cos(yaw)])
        x, y = surface.points[:, :2] @ closing, surface.points[:, :2] @ across
        facing = surface.normals[:, :2] @ closing
        flat = _Slice(x, y, surface.points[:, 2], facing)
        for place in _places(y, float(surface.centroid[:2] @ across), settings.place_step_m):
            grasp = _grasp_at(flat, place, yaw, surface, support_z, gripper, settings)
            if grasp is not None:
                grasps.append(grasp)
    return sorted(grasps, key=lambda grasp: -grasp.quality)


@dataclass(frozen=True, slots=True)
class _Slice:
    """Surface points in the directions of the hand: x closing, y across, z up, and how much each faces along x."""

    x: Array
    y: Array
    z: Array
    facing: Array


def _directions(surface: Surface, step: float) -> list[float]:
    """Closing directions within half a turn: those of the object's sides first, then a regular fan."""
    sides = [math.atan2(axis[1], axis[0]) % math.pi for axis in surface.axes if math.hypot(axis[0], axis[1]) > 0.9]
    fan = [index * step for index in range(max(1, round(math.pi / step)))]
    chosen: list[float] = []
    for yaw in [*sides, *fan]:
        gaps = [abs((yaw - other + math.pi / 2) % math.pi - math.pi / 2) for other in chosen]
        if all(gap > SAME_DIRECTION_RAD for gap in gaps):
            chosen.append(yaw)
    return chosen


def _places(y: Array, centre: float, step: float) -> Iterable[float]:
    """Places along the object: at its centre of mass, then outwards to both ends."""
    yield centre
    for index in range(1, 1 + int(max(y.max() - centre, centre - y.min()) / step)):
        for place in (centre + index * step, centre - index * step):
            if y.min() < place < y.max():
                yield place


def _grasp_at(flat: _Slice, place: float, yaw: float, surface: Surface, support_z: float, gripper: GripperGeometry,
              settings: TopDownSettings) -> TopDownGrasp | None:
    between = np.abs(flat.y - place) <= gripper.pad_half_width
    if not between.any():
        return None
    width_guess = min(float(np.ptp(flat.x[between])), gripper.max_opening)
    pad_offset = gripper.pad_centre_at(width_guess)
    top = float(flat.z[np.abs(flat.y - place) <= gripper.pad_half_width + 0.01].max())
    wanted = min(float(surface.centroid[2]), top - gripper.pad_half_height / 2) + pad_offset
    lowest = max(top + gripper.palm, support_z + gripper.max_tip) + settings.tip_clearance_m
    z = max(wanted, lowest)
    pad_z = z - pad_offset
    touching = between & (np.abs(flat.z - pad_z) <= gripper.pad_half_height)
    overlap = min(top, pad_z + gripper.pad_half_height) - (pad_z - gripper.pad_half_height)
    if overlap < settings.min_pad_overlap_m or not touching.any():
        return None
    low, high = float(flat.x[touching].min()), float(flat.x[touching].max())
    straddled = flat.x[between & (flat.z >= z - gripper.max_tip)]
    middle = (low + high) / 2
    straddle = 2 * max(float(straddled.max()) - middle, middle - float(straddled.min()))
    opening = straddle + 2 * settings.finger_clearance_m
    if opening > gripper.max_opening:
        return None
    alignment = min(_alignment(flat, touching & (flat.x <= low + CONTACT_DEPTH_M), -1.0),
                    _alignment(flat, touching & (flat.x >= high - CONTACT_DEPTH_M), 1.0))
    if alignment < settings.min_side_alignment:
        return None
    closing, across = (math.cos(yaw), math.sin(yaw)), (math.sin(yaw), -math.cos(yaw))
    position = (middle * closing[0] + place * across[0], middle * closing[1] + place * across[1], z)
    offset = math.dist((position[0], position[1], pad_z), tuple(surface.centroid))
    quality = _quality(alignment, offset, (gripper.max_opening - opening) / gripper.max_opening,
                       overlap / (2 * gripper.pad_half_height), position, settings)
    return TopDownGrasp(position, yaw, high - low, gripper.position_for(opening), quality)


def _alignment(flat: _Slice, side: npt.NDArray[np.bool_], sign: float) -> float:
    """How squarely the outermost points face a pad: the mean cosine of those that face it at all."""
    facing = sign * flat.facing[side]
    facing = facing[facing > 0.3]
    return float(facing.mean()) if facing.size else 0.0


def _quality(alignment: float, offset_m: float, room: float, overlap: float, position: tuple[float, float, float],
             settings: TopDownSettings) -> float:
    reach = math.dist(position[:2], settings.base_xy_m)
    comfort = 1.0 - min(1.0, abs(reach - settings.best_reach_m) / 0.5)
    centred = 1.0 - min(1.0, offset_m / 0.06)
    squareness = (alignment - settings.min_side_alignment) / (1.0 - settings.min_side_alignment)
    return 0.3 * squareness + 0.3 * centred + 0.15 * room + 0.1 * min(1.0, overlap) + 0.15 * comfort
