# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ranks grasps of a two-finger hand at pairs of contacts.

Each pair is combined with several approach directions around its closing axis (:mod:`hand_poses`). Poses with a
collision during the approach or the closing motion are rejected. The quality of a grasp depends on the alignment of the
contact normals, the distance of the closing axis from the centre of mass, the distance from other objects, the overlap
of pads and object, and the opening.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from modular_framework_core.grasp_generation.contact_pair import ContactPair
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery, NoCandidatesError
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_poses import HandPose, HandSettings, hand_axes_for, place_hand
from modular_framework_core.grasp_generation.obstacle_clearance import ObstacleClearance

T = TypeVar("T")

MAX_OFFSET_M = 0.06
"""Distance of the closing axis from the centre of mass beyond which a grasp counts as not centred."""
ANGLE_BINS = 4
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
FAR_TRAVEL, TRAVEL_WEIGHT = 1.5, 0.2
"""Joint travel of a change of the arm configuration [rad], and weight of the joint travel in the quality."""


@dataclass(frozen=True, slots=True)
class PairGraspSettings:
    """Settings of the search for grasps at pairs of contacts.

    Attributes:
        hand: Settings of hand pose and hand motion.
        full_clearance_m: Distance from other objects beyond which the quality does not increase [m].
        max_poses: Maximum number of hand poses to check.
        max_candidates: Maximum number of returned grasps.
    """

    hand: HandSettings = field(default_factory=HandSettings)
    full_clearance_m: float = 0.03
    max_poses: int = 400
    max_candidates: int = 80

    def squareness(self, alignment: float) -> float:
        """Returns the alignment scaled to [0, 1]: 1 for parallel sides, 0 at the edge of the friction cone."""
        edge = self.hand.cone_cosine
        return max(0.0, (alignment - edge) / (1.0 - edge))

    def widest(self, gripper: GripperGeometry) -> float:
        """Returns the maximum distance of two contacts that fit between the pads of a gripper [m]."""
        return gripper.max_opening - 2 * self.hand.min_finger_clearance_m


@dataclass(frozen=True, slots=True)
class PairGrasp:
    """Grasp at a pair of contacts.

    Attributes:
        pose: Pose of the hand at the grasp.
        clearance: Minimum distance from other objects during the motion [m], at most `full_clearance_m`.
        offset: Distance of the closing axis from the centre of mass [m].
        quality: Quality in [0, 1]; higher is better.
    """

    pose: HandPose
    clearance: float
    offset: float
    quality: float


def grasps_on_pairs(pairs: Sequence[ContactPair], query: GraspQuery, settings: PairGraspSettings) -> list[PairGrasp]:
    """Finds the grasps of an object at pairs of contacts; the result is deterministic.

    Args:
        pairs: Pairs of contacts.
        query: Object, obstacles and hand.
        settings: Settings of the search.

    Returns:
        Collision-free grasps in the order for reachability checks. The order alternates between inclinations of the
        hand, best grasps first, because the arm may reach the object with a single inclination only. Empty if no pose
        of the hand fits the object.

    Raises:
        NoCandidatesError: Every pose of the hand that fits the object collides with other objects.
    """
    surroundings = ObstacleClearance(query.obstacles, query.gripper, settings.full_clearance_m)
    grasps: list[PairGrasp] = []
    for pair, axes in itertools.islice(_poses_to_try(pairs, query, settings), settings.max_poses):
        pose = place_hand(
            pair, axes, query.target.surface, query.support_z, gripper=query.gripper, settings=settings.hand
        )
        if pose is None:
            continue
        clearance = surroundings.grasp_clearance(
            pose.position, pose.axes, (pose.opening, pose.width), settings.hand.approach_distance_m
        )
        if clearance > 0.0:
            grasps.append(_rate_grasp(pose, clearance, query, settings))
            if len(grasps) >= settings.max_candidates:
                break
    if surroundings.collisions and not grasps:
        name, count = surroundings.collisions.most_common(1)[0]
        raise NoCandidatesError(
            f"all {surroundings.collisions.total()} hand poses that fit the object collide with other objects during "
            f"approach or closing, {count} of them with '{name}'"
        )
    return _interleave_angle_bins([(grasp.pose.approach_angle, grasp.quality, grasp) for grasp in grasps], settings)


def candidates_of(
    grasps: Sequence[PairGrasp], gripper: GripperGeometry, settings: PairGraspSettings
) -> list[GraspCandidate]:
    """Returns the candidates of pair grasps: all grasps, then all grasps with a symmetric hand rotated by 180 degrees.

    Args:
        grasps: Grasps at pairs of contacts.
        gripper: Geometry of the hand.
        settings: Settings of the search, including the distances of approach and lift.
    """
    return [
        GraspCandidate(
            grasp.pose.position + grasp.pose.axes @ (pads - turn @ pads),
            grasp.pose.axes @ turn,
            gripper.position_for(grasp.pose.opening),
            settings.hand.approach_distance_m,
            settings.hand.lift_distance_m,
            grasp.quality,
        )
        for turn in ((np.eye(3), HALF_TURN) if gripper.is_symmetric else (np.eye(3),))
        for grasp in grasps
        for pads in [gripper.pad_centre_at(grasp.pose.opening)]
    ]


def quality_with_travel(quality: float, joint_travel: float) -> float:
    """Returns the quality of a grasp reduced by the joint travel [rad or m] between its poses; both are in [0, 1]."""
    return (1.0 - TRAVEL_WEIGHT) * quality + TRAVEL_WEIGHT * (1.0 - min(1.0, joint_travel / FAR_TRAVEL))


def _poses_to_try(
    pairs: Sequence[ContactPair], query: GraspQuery, settings: PairGraspSettings
) -> Iterator[tuple[ContactPair, np.ndarray]]:
    """Yields pairs with axes of the hand; alternates between inclinations, well aligned and centred pairs first.

    A hand that is not symmetric is also tried with the pads exchanged.
    """
    centroid = query.target.surface.centroid
    turns = (np.eye(3),) if query.gripper.is_symmetric else (np.eye(3), HALF_TURN)
    tries = []
    for pair in pairs:
        score = settings.squareness(pair.alignment) + _centring_quality(pair.distance_from(centroid))
        for axes in hand_axes_for(pair.axis, settings.hand):
            angle = float(np.arccos(np.clip(-axes[2, 2], -1.0, 1.0)))
            tries += [(angle, score, (pair, axes @ turn)) for turn in turns]
    yield from _interleave_angle_bins(tries, settings)


def _interleave_angle_bins(items: list[tuple[float, float, T]], settings: PairGraspSettings) -> list[T]:
    """Orders items (approach angle, score, item): the best item of each bin of angles, then the second best, ..."""
    width = settings.hand.max_approach_angle_rad / ANGLE_BINS
    bins: list[list[tuple[float, float, T]]] = [[] for _ in range(ANGLE_BINS)]
    for item in items:
        bins[min(ANGLE_BINS - 1, int(item[0] / width))].append(item)
    ranked_bins = [sorted(each, key=lambda item: -item[1]) for each in bins]
    return [item[2] for rank in itertools.zip_longest(*ranked_bins) for item in rank if item is not None]


def _rate_grasp(pose: HandPose, clearance: float, query: GraspQuery, settings: PairGraspSettings) -> PairGrasp:
    gripper: GripperGeometry = query.gripper
    axis = pose.axes[:, 0]
    from_centre = query.target.surface.centroid - pose.contacts.mean(axis=0)
    offset = float(np.linalg.norm(from_centre - axis * (from_centre @ axis)))
    quality = (
        0.25 * settings.squareness(pose.alignment)
        + 0.25 * _centring_quality(offset)
        + 0.25 * min(1.0, clearance / settings.full_clearance_m)
        + 0.15 * min(1.0, pose.overlap / (2 * gripper.pad_half_height))
        + 0.10 * (gripper.max_opening - pose.opening) / gripper.max_opening
    )
    return PairGrasp(pose, clearance, offset, quality)


def _centring_quality(offset: float) -> float:
    return 1.0 - min(1.0, offset / MAX_OFFSET_M)
