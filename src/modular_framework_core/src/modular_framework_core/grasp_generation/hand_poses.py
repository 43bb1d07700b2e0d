# SPDX-License-Identifier: BSD-3-Clause
"""Computes poses and openings of a two-finger hand for a pair of contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.contact_pair import ContactPair
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_clearance import (
    CONTACT_DEPTH_M,
    HEIGHT_ROUNDS,
    HEIGHT_TOLERANCE_M,
    Passage,
    highest_points,
    lowest_height,
    passage_between,
)
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.surface_points import Surface

Array = npt.NDArray[np.float64]

DOWN = np.array([0.0, 0.0, -1.0])
UPRIGHT = 1e-3
MIN_FACING_COSINE = 0.3
LEVEL = 0.05
"""Minimum downward component of an approach direction for which a retreat lifts the hand."""


@dataclass(frozen=True, slots=True)
class HandSettings(HandMotionSettings):
    """Settings of the hand pose.

    Attributes:
        approach_step_rad: Step between approach directions around a closing axis [rad].
        max_approach_angle_rad: Maximum angle between the approach direction and straight down [rad].
        cone_cosine: Cosine of the half angle of the friction cone.
    """

    approach_step_rad: float = math.radians(30.0)
    max_approach_angle_rad: float = math.radians(95.0)
    cone_cosine: float = 0.95


@dataclass(frozen=True, slots=True)
class HandPose:
    """Pose of the hand at which the pads close on an object.

    Attributes:
        position: Position of the grasp frame, shape (3,) [m].
        axes: Axes of the hand, as columns: closing, across, approach; shape (3, 3).
        contacts: Centre of the contact area of each pad, shape (2, 3) [m].
        alignment: Smaller cosine between the line through the contacts and the surface normal at a contact.
        width: Distance between the pads at contact [m].
        opening: Free width between the pads during the approach [m].
        overlap: Length of the contact along the approach direction [m].
    """

    position: Array
    axes: Array
    contacts: Array
    alignment: float
    width: float
    opening: float
    overlap: float

    @property
    def approach_angle(self) -> float:
        """Angle between the approach direction and straight down [rad]."""
        return math.acos(float(np.clip(self.axes[:, 2] @ DOWN, -1.0, 1.0)))


def hand_axes_for(axis: Array, settings: HandSettings) -> Iterator[Array]:
    """Yields axes of the hand, shape (3, 3), for a closing axis of shape (3,); the steepest approach comes first."""
    across = np.cross(axis, DOWN)
    if np.linalg.norm(across) < UPRIGHT:
        across = np.array([1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    steepest = np.cross(across, axis)  # the steepest direction perpendicular to the axis
    count = int(math.pi / settings.approach_step_rad)
    angles = [0.0, *(sign * step * settings.approach_step_rad for step in range(1, count + 1) for sign in (1.0, -1.0))]
    for angle in angles:
        if angle <= -math.pi + 1e-6:
            continue
        approach = math.cos(angle) * steepest + math.sin(angle) * across
        if approach @ DOWN >= math.cos(settings.max_approach_angle_rad):
            yield np.column_stack([axis, np.cross(approach, axis), approach])


def place_hand(
    pair: ContactPair,
    axes: Array,
    surface: Surface,
    support_z: float,
    *,
    gripper: GripperGeometry,
    settings: HandSettings,
) -> HandPose | None:
    """Returns the deepest pose of the hand at which the pads close on a pair of contacts, or None without such a pose.

    Only the pads may touch the object, and all parts keep their clearances from the object and the support. The opening
    depends on the depth of the pose, and the allowed depth depends on the opening. An iteration computes both; it
    converges, because each step only retracts the hand.

    Args:
        pair: Pair of contacts.
        axes: Axes of the hand, as columns: closing, across, approach; shape (3, 3).
        surface: Points on the object.
        support_z: Height of the surface that supports the object [m].
        gripper: Geometry of the hand.
        settings: Settings of the hand pose.
    """
    view = _PairView.along(pair, axes, surface, gripper, settings)
    pad_offset = float(gripper.pad_centre_at(pair.width)[2])
    farthest = pad_offset + gripper.pad_half_height - settings.min_pad_overlap_m / 2
    height = pad_offset
    for _ in range(HEIGHT_ROUNDS):
        hold = view.hold_at(height, pad_offset)
        if hold is None:
            return None
        needed = 2 * (hold.passage.half_width + hold.passage.clearance)
        if view.height_over_support(hold, needed, support_z) > farthest:
            return None
        lowest, opening = lowest_height(view.top - [hold.passage.middle, 0.0, 0.0], hold.passage, height, gripper)
        lowest = max(lowest, view.height_over_support(hold, opening, support_z))
        if lowest > farthest:
            return None
        if lowest <= height + HEIGHT_TOLERANCE_M:
            return view.pose(hold, height, opening)
        height = lowest
    return None


@dataclass(frozen=True, slots=True)
class _PairView:
    """Object in a frame at the midpoint of the pair: x closing, y across, z against the approach direction.

    Attributes:
        pair: Pair of contacts.
        axes: Axes of the hand in the world, as columns: closing, across, approach; shape (3, 3).
        points: Points that can be between the pads, shape (n, 3) [m].
        normals: Outward normals at these points, shape (n, 3).
        top: Highest points of the object in this frame, shape (m, 3) [m].
        gripper: Geometry of the hand.
        settings: Settings of the hand pose.
    """

    pair: ContactPair
    axes: Array
    points: Array
    normals: Array
    top: Array
    gripper: GripperGeometry
    settings: HandSettings

    @classmethod
    def along(
        cls, pair: ContactPair, axes: Array, surface: Surface, gripper: GripperGeometry, settings: HandSettings
    ) -> _PairView:
        frame = axes * [1.0, -1.0, -1.0]
        points = (surface.points - pair.middle) @ frame
        between = (np.abs(points[:, 1]) <= gripper.pad_half_width) & (
            np.abs(points[:, 0]) <= pair.width / 2 + settings.finger_clearance_m
        )
        return cls(
            pair=pair,
            axes=axes,
            points=points[between],
            normals=surface.normals[between] @ frame,
            top=highest_points(points) * [1.0, -1.0, 1.0],
            gripper=gripper,
            settings=settings,
        )

    def hold_at(self, height: float, pad_offset: float) -> _PairHold | None:
        pad_z = height - pad_offset
        points, gripper, settings = self.points, self.gripper, self.settings
        touching = np.abs(points[:, 2] - pad_z) <= gripper.pad_half_height
        if not touching.any():
            return None
        x = points[touching, 0]
        sides = [
            _side(points[touching], self.normals[touching], x <= x.min() + CONTACT_DEPTH_M, -1.0),
            _side(points[touching], self.normals[touching], x >= x.max() - CONTACT_DEPTH_M, 1.0),
        ]
        if sides[0] is None or sides[1] is None:
            return None
        (low, low_normal), (high, high_normal) = sides[0], sides[1]
        line = (high - low) / np.linalg.norm(high - low)
        alignment = min(float(-low_normal @ line), float(high_normal @ line))
        z = points[touching, 2]
        overlap = float(z.max() - z.min())
        if alignment < settings.cone_cosine or overlap < settings.min_pad_overlap_m:
            return None
        passed = points[points[:, 2] >= pad_z - gripper.pad_half_height, 0]
        passage = passage_between(x, passed, gripper, settings)
        return None if passage is None else _PairHold(low, high, alignment, overlap, passage)

    def height_over_support(self, hold: _PairHold, opening: float, support_z: float) -> float:
        """Returns the minimum height of the grasp frame at which the hand keeps its clearance from the support [m]."""
        gripper, axes = self.gripper, self.axes
        samples = np.flatnonzero((gripper.openings >= hold.passage.width) & (gripper.openings <= opening))
        samples = samples if len(samples) else np.array([int(np.argmin(np.abs(gripper.openings - opening)))])
        reach = min(float((part.corners[samples] @ axes[2]).min()) for part in gripper.parts)
        sideways = [hold.passage.middle, 0.0] - gripper.pad_centre_at(opening)[:2]
        middle_z = float(self.pair.middle[2] + axes[2, :2] @ sideways)
        missing = support_z + self.settings.tip_clearance_m - (middle_z + reach)
        lift = -float(axes[2, 2])
        if lift > LEVEL:
            return missing / lift
        return -math.inf if missing + max(0.0, -lift) * gripper.max_tip <= 0.0 else math.inf

    def pose(self, hold: _PairHold, height: float, opening: float) -> HandPose:
        frame = self.axes * [1.0, -1.0, -1.0]
        pads = self.gripper.pad_centre_at(opening)
        return HandPose(
            position=self.pair.middle + self.axes @ [hold.passage.middle - pads[0], -pads[1], -height],
            axes=self.axes,
            contacts=self.pair.middle + np.array([hold.low, hold.high]) @ frame.T,
            alignment=hold.alignment,
            width=hold.passage.width,
            opening=opening,
            overlap=hold.overlap,
        )


@dataclass(frozen=True, slots=True)
class _PairHold:
    """Contact of the pads at one height: contact centre of each side, alignment, overlap, and passage."""

    low: Array
    high: Array
    alignment: float
    overlap: float
    passage: Passage


def _side(points: Array, normals: Array, outermost: npt.NDArray[np.bool_], sign: float) -> tuple[Array, Array] | None:
    """Returns the centre and the mean normal of the outermost points that face a pad, or None without such points."""
    facing = outermost & (sign * normals[:, 0] > MIN_FACING_COSINE)
    if not facing.any():
        return None
    normal = normals[facing].mean(axis=0)
    low, high = points[facing].min(axis=0), points[facing].max(axis=0)
    return (low + high) / 2, normal / np.linalg.norm(normal)
