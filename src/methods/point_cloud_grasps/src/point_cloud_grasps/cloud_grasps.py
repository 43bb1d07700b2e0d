# SPDX-License-Identifier: BSD-3-Clause
"""Finds and ranks antipodal grasps of an object in a point cloud.

Of the planning scene only the name, the place and the rough size of the object are used: where to look. Its shape is
what the camera sees there (:mod:`segmentation`, :mod:`seen_shape`). Pairs of contacts are drawn from it
(:mod:`cloud_pairs`), not deeper below what was seen than the pads are long in half: nobody knows what is there. The
hand keeps off the other points of the cloud as well as off the objects of the planning scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation import solid_meshes
from modular_framework_core.grasp_generation.contact_pair import ContactPair
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery, NoCandidatesError
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.pair_grasps import PairGrasp, PairGraspSettings, grasps_on_pairs
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_core.grasp_generation.surface_points import Surface
from modular_framework_urdf.mesh_reader import TriangleMesh
from point_cloud_grasps.cloud_pairs import CloudPairSettings, sample_pairs
from point_cloud_grasps.seen_shape import SeenShape, completed_shape
from point_cloud_grasps.segmentation import (
    SupportPlane,
    clusters,
    find_support,
    has_neighbours,
    point_spacing,
    thinned,
)

Array = npt.NDArray[np.float64]

SUPPORT_SEARCH_M = 0.03
"""What the object stands on is looked for this far above and below where the planning scene says it is."""
GAP_SPACINGS, LEAST_GAP_M = 2.5, 0.008
"""Of two things the points are farther apart than this."""
OBSTACLE_CELL_M = 0.01
FEWEST_POINTS = 6


@dataclass(frozen=True, slots=True)
class CloudSettings(PairGraspSettings):
    """What counts as usable, how much is tried, and how grasps are ranked.

    Attributes:
        pairs: How pairs of contacts are found.
        region_padding_m: The object is looked for this far around where the planning scene has it [m].
        min_height_m: Points less than this above the support belong to it [m].
    """

    pairs: CloudPairSettings = field(default_factory=CloudPairSettings)
    region_padding_m: float = 0.03
    min_height_m: float = 0.006


@dataclass(frozen=True, slots=True)
class Region:
    """A box along the axes of the planning frame.

    Attributes:
        low: (3,) smallest x, y, z [m].
        high: (3,) greatest [m].
    """

    low: Array
    high: Array

    def padded(self, margin: float) -> Region:
        """Returns the region with so much more on each side [m]."""
        return Region(self.low - margin, self.high + margin)

    def hold(self, points: Array) -> npt.NDArray[np.bool_]:
        """Returns which points (n, 3) are inside."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))


def gap_between_things(spacing: float) -> float:
    """Returns the gap between points beyond which they are of two things [m], if a thing's are so far apart [m]."""
    return max(LEAST_GAP_M, GAP_SPACINGS * spacing)


def region_of(target: SceneObject, settings: CloudSettings) -> Region:
    """Returns where the points of an object may be."""
    points = target.surface.points
    return Region(points.min(axis=0), points.max(axis=0)).padded(settings.region_padding_m)


def surroundings_of(query: GraspQuery, settings: CloudSettings) -> Region:
    """Returns where points matter: around the object as far as the hand reaches that comes to it."""
    hand = max(float(np.linalg.norm(part.corners.reshape(-1, 3), axis=1).max()) for part in query.gripper.parts)
    return region_of(query.target, settings).padded(hand + settings.hand.approach_distance_m)


def cloud_grasps(query: GraspQuery, points: Array, settings: CloudSettings) -> list[PairGrasp]:
    """Finds the grasps of an object; the same query and points give the same grasps.

    Args:
        query: The object and where it is, what is known to stand around it, and the hand.
        points: (n, 3) what the camera sees in the planning frame, none of them on the robot [m].
        settings: What counts as usable.

    Returns:
        Usable grasps in the order in which their reachability should be checked.

    Raises:
        NoCandidatesError: There are none; the text says why.
    """
    generator = np.random.default_rng(query.seed)
    points = thinned(points[surroundings_of(query, settings).hold(points)])
    support = _support(query, points, generator)
    points = points[support.heights(points) > settings.min_height_m]
    points, spacing = _surface_points(query, points, settings)
    own = _own_points(query, points, spacing, settings)
    target_points = points[own]
    support_z = support.z_at(*target_points[:, :2].mean(axis=0).tolist())
    shape = completed_shape(target_points, spacing, support_z)
    seen = SceneObject(query.target.name, shape.surface)
    others = _columns(points[~own], support_z)
    obstacles = (*query.obstacles, others) if others else query.obstacles
    seen_query = replace(query, target=seen, obstacles=obstacles, support_z=support_z)
    pairs = _pairs(shape, query.gripper, settings, generator)
    grasps = grasps_on_pairs(pairs, seen_query, settings)
    if not grasps:
        raise NoCandidatesError(
            f"{len(pairs)} pairs of contacts fit the gripper, but in none of the directions tried does the hand come "
            "to one without touching the object, the support, other points of the cloud or objects of the scene"
        )
    return grasps


def _support(query: GraspQuery, points: Array, generator: np.random.Generator) -> SupportPlane:
    """Returns what the object stands on: as it is seen, or where it is said to be if nothing of it is seen."""
    around = points[np.abs(points[:, 2] - query.support_z) <= SUPPORT_SEARCH_M]
    return find_support(around, generator) or SupportPlane(np.array([0.0, 0.0, 1.0]), query.support_z)


def _surface_points(query: GraspQuery, points: Array, settings: CloudSettings) -> tuple[Array, float]:
    """Returns the points above the support without those that are alone, and how far those of the object are apart [m].

    Raises:
        NoCandidatesError: There are too few on the object.
    """
    region = region_of(query.target, settings)
    spacing = point_spacing(points[region.hold(points)])
    points = points[has_neighbours(points, spacing)] if len(points) else points
    found = int(region.hold(points).sum())
    if found < FEWEST_POINTS:
        low, high = (", ".join(f"{value:.3f}" for value in end) for end in (region.low, region.high))
        raise NoCandidatesError(
            f"the cloud has {found} points on '{query.target.name}', at least {FEWEST_POINTS} are needed, more than "
            f"{settings.min_height_m * 1000:.0f} mm above what it stands on and off the robot, between ({low}) and "
            f"({high}) m; is it in view of the camera, and nothing in front of it?"
        )
    return points, spacing


def _own_points(query: GraspQuery, points: Array, spacing: float, settings: CloudSettings) -> npt.NDArray[np.bool_]:
    """Returns which points above the support are those of the object.

    They are those in its region; without the clusters that reach into it from outside, unless nothing else is left,
    as where the object touches something larger.
    """
    inside = region_of(query.target, settings).hold(points)
    labels = clusters(points[:, :2], gap_between_things(spacing))
    shares = np.bincount(labels, weights=inside) / np.bincount(labels)
    own = inside & (shares[labels] > 0.5)
    return own if own.sum() >= FEWEST_POINTS else inside


def _pairs(
    shape: SeenShape, gripper: GripperGeometry, settings: CloudSettings, generator: np.random.Generator
) -> list[ContactPair]:
    surface = shape.surface
    known = shape.unseen_m <= gripper.pad_half_height
    widest = settings.widest(gripper)
    found = sample_pairs(
        surface.points[known], surface.normals[known], surface.centroid, widest, settings.pairs, generator
    )
    if found.pairs:
        return found.pairs
    opening = (
        f"the gripper opens to {gripper.max_opening * 1000:.0f} mm, of which {widest * 1000:.0f} mm are free with "
        f"{settings.hand.min_finger_clearance_m * 1000:.0f} mm of room on each side"
    )
    if math.isinf(found.narrowest_m):
        raise NoCandidatesError(
            f"of {int(known.sum())} contacts that were seen no two face each other within the friction cone of "
            f"{settings.pairs.friction:g}; {opening}"
        )
    raise NoCandidatesError(
        f"no pair of contacts fits: the narrowest is {found.narrowest_m * 1000:.0f} mm wide, and {opening}"
    )


def _columns(points: Array, support_z: float) -> SceneObject | None:
    """Returns what else was seen as square columns that stand on the support; None if there is nothing else."""
    if not len(points):
        return None
    cells = np.floor(points[:, :2] / OBSTACLE_CELL_M).astype(np.int64)
    unique, which = np.unique(cells, axis=0, return_inverse=True)
    tops = np.full(len(unique), -math.inf)
    np.maximum.at(tops, which.ravel(), points[:, 2])
    heights = tops - support_z
    unit = solid_meshes.box((1.0, 1.0, 1.0))
    sizes = np.column_stack([np.full((len(unique), 2), OBSTACLE_CELL_M), heights])
    middles = np.column_stack([(unique + 0.5) * OBSTACLE_CELL_M, support_z + heights / 2])
    corners = (unit.vertices[None] * sizes[:, None] + middles[:, None]).reshape(-1, 3)
    starts = np.arange(len(unique))[:, None, None] * len(unit.vertices)
    solid = TriangleMesh(corners, (unit.triangles[None] + starts).reshape(-1, 3))
    surface = Surface(corners, np.zeros_like(corners), float(sizes.prod(axis=1).sum()), corners.mean(axis=0), np.eye(3))
    return SceneObject("other points of the cloud", surface, (solid,))
