# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ranks the ways in which a two-finger hand can close on pairs of contacts.

Around the closing axis of each pair the hand is turned through several approach directions and placed
(:mod:`hand_poses`). Poses at which it would touch another object on its way, or while it closes, are left out. What
remains is ranked by how squarely the sides face each other, how near the closing axis is to the centre of mass, the
distance from other objects, how much of the pads touches, and how much room there is between the pads.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from modular_framework_core.grasp_generation.contact_pair import ContactPair
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.hand_poses import HandPose, HandSettings, hand_axes_for, place_hand
from modular_framework_core.grasp_generation.obstacle_clearance import ObstacleClearance

T = TypeVar("T")

CENTRED_M = 0.06
"""Distance of the closing axis from the centre of mass at which a grasp is no longer centred."""
ANGLE_BINS = 4
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
FAR_TRAVEL, TRAVEL_SHARE = 1.5, 0.2
"""A joint that moves this far [rad] between two poses of a grasp has swung to another posture of the arm."""


@dataclass(frozen=True, slots=True)
class PairGraspSettings:
    """What counts as usable, how much is tried, and how grasps are ranked.

    Attributes:
        hand: How the hand comes to the pairs, is placed on them, and leaves.
        full_clearance_m: Distance from other objects beyond which more is no better [m].
        max_poses: Greatest number of poses of the hand that are tried.
        max_candidates: Greatest number of grasps to return.
    """

    hand: HandSettings = field(default_factory=HandSettings)
    full_clearance_m: float = 0.03
    max_poses: int = 400
    max_candidates: int = 80

    def squareness(self, alignment: float) -> float:
        """Returns how squarely two sides face each other: 1 for parallel sides, 0 at the edge of the friction cone."""
        least = self.hand.cone_cosine
        return max(0.0, (alignment - least) / (1.0 - least))

    def widest(self, gripper: GripperGeometry) -> float:
        """Returns the greatest distance of two contacts that fit between the pads of a gripper [m]."""
        return gripper.max_opening - 2 * self.hand.min_finger_clearance_m


@dataclass(frozen=True, slots=True)
class PairGrasp:
    """One way to grasp.

    Attributes:
        pose: The hand at the grasp.
        clearance: Least distance from other objects on the way [m], at most `full_clearance_m` of the settings.
        offset: Distance of the closing axis from the centre of mass [m].
        quality: Rank in [0, 1]; more is better.
    """

    pose: HandPose
    clearance: float
    offset: float
    quality: float


def grasps_on_pairs(pairs: Sequence[ContactPair], query: GraspQuery, settings: PairGraspSettings) -> list[PairGrasp]:
    """Finds the grasps of an object at pairs of contacts; the same query gives the same grasps.

    Args:
        pairs: The pairs.
        query: The object, what stands around it, and the hand.
        settings: What counts as usable.

    Returns:
        Usable grasps in the order in which their reachability should be checked: the best of each inclination of the
        hand in turn, since the arm may reach an object in one of them only.
    """
    surroundings = ObstacleClearance(query.obstacles, query.gripper, settings.full_clearance_m)
    grasps: list[PairGrasp] = []
    for pair, axes in itertools.islice(_poses_to_try(pairs, query, settings), settings.max_poses):
        pose = place_hand(
            pair, axes, query.target.surface, query.support_z, gripper=query.gripper, settings=settings.hand
        )
        if pose is None:
            continue
        clearance = surroundings.of_grasp(
            pose.position, pose.axes, (pose.opening, pose.width), settings.hand.approach_distance_m
        )
        if clearance > 0.0:
            grasps.append(_ranked(pose, clearance, query, settings))
            if len(grasps) >= settings.max_candidates:
                break
    return _in_turns([(grasp.pose.approach_angle, grasp.quality, grasp) for grasp in grasps], settings)


def candidates_of(
    grasps: Sequence[PairGrasp], gripper: GripperGeometry, settings: PairGraspSettings
) -> list[GraspCandidate]:
    """Returns the candidates of pair grasps: each grasp, then each grasp with the hand turned by 180 degrees.

    Args:
        grasps: Poses and openings of the hand.
        gripper: Gripper that grasps.
        settings: Settings of the search; give the distances of approach and lift.
    """
    return [
        GraspCandidate(
            grasp.pose.position,
            grasp.pose.axes @ turn,
            gripper.position_for(grasp.pose.opening),
            settings.hand.approach_distance_m,
            settings.hand.lift_distance_m,
            grasp.quality,
        )
        for turn in (np.eye(3), HALF_TURN)
        for grasp in grasps
    ]


def quality_with_travel(quality: float, joint_travel: float) -> float:
    """Ranks by the quality of the hold [0, 1], and by how little the arm moves between the poses [rad or m]."""
    return (1.0 - TRAVEL_SHARE) * quality + TRAVEL_SHARE * (1.0 - min(1.0, joint_travel / FAR_TRAVEL))


def _poses_to_try(
    pairs: Sequence[ContactPair], query: GraspQuery, settings: PairGraspSettings
) -> Iterator[tuple[ContactPair, np.ndarray]]:
    """Yields pairs with axes of the hand: of each inclination in turn, well aligned and centred pairs first."""
    centroid = query.target.surface.centroid
    tries = []
    for pair in pairs:
        worth = settings.squareness(pair.alignment) + _centred(pair.distance_from(centroid))
        for axes in hand_axes_for(pair.axis, settings.hand):
            angle = float(np.arccos(np.clip(-axes[2, 2], -1.0, 1.0)))
            tries.append((angle, worth, (pair, axes)))
    yield from _in_turns(tries, settings)


def _in_turns(items: list[tuple[float, float, T]], settings: PairGraspSettings) -> list[T]:
    """Orders items (angle of approach, worth, item): the best of each bin of angles, then the second of each, ..."""
    width = settings.hand.max_approach_angle_rad / ANGLE_BINS
    bins: list[list[tuple[float, float, T]]] = [[] for _ in range(ANGLE_BINS)]
    for item in items:
        bins[min(ANGLE_BINS - 1, int(item[0] / width))].append(item)
    turns = [sorted(each, key=lambda item: -item[1]) for each in bins]
    return [item[2] for turn in itertools.zip_longest(*turns) for item in turn if item is not None]


def _ranked(pose: HandPose, clearance: float, query: GraspQuery, settings: PairGraspSettings) -> PairGrasp:
    gripper: GripperGeometry = query.gripper
    axis = pose.axes[:, 0]
    from_centre = query.target.surface.centroid - pose.contacts.mean(axis=0)
    offset = float(np.linalg.norm(from_centre - axis * (from_centre @ axis)))
    quality = (
        0.25 * settings.squareness(pose.alignment)
        + 0.25 * _centred(offset)
        + 0.25 * min(1.0, clearance / settings.full_clearance_m)
        + 0.15 * min(1.0, pose.overlap / (2 * gripper.pad_half_height))
        + 0.10 * (gripper.max_opening - pose.opening) / gripper.max_opening
    )
    return PairGrasp(pose, clearance, offset, quality)


def _centred(offset: float) -> float:
    return 1.0 - min(1.0, offset / CENTRED_M)
