# SPDX-License-Identifier: BSD-3-Clause
"""Generates and ranks antipodal grasps of an object in a point cloud.

The planning scene gives only the search region: the name, position and approximate size of the object. Its shape comes
from the cloud (:mod:`segmentation`, :mod:`seen_shape`). Contact pairs are sampled from that shape
(:mod:`cloud_pairs`), at most half a pad height below the visible surface. The shape further below is unknown. The hand
avoids the other points of the cloud as well as the objects of the planning scene.
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
    cluster_labels,
    downsample_points,
    find_support,
    has_neighbours,
    point_spacing,
)

Array = npt.NDArray[np.float64]

SUPPORT_SEARCH_M = 0.03
"""Range above and below the planning scene's support height in which the support is searched."""
GAP_SPACINGS, MIN_GAP_M = 2.5, 0.008
"""Minimum gap between the points of two objects."""
OBSTACLE_CELL_M = 0.01
MIN_POINTS = 6


@dataclass(frozen=True, slots=True)
class CloudSettings(PairGraspSettings):
    """Feasibility limits, search effort and ranking of grasps.

    Attributes:
        pairs: Settings of the contact pairs.
        region_padding_m: Padding of the object's bounding box in the planning scene, for the search region [m].
        min_height_m: Maximum height above the support at which points belong to the support [m].
    """

    pairs: CloudPairSettings = field(default_factory=CloudPairSettings)
    region_padding_m: float = 0.03
    min_height_m: float = 0.006


@dataclass(frozen=True, slots=True)
class Region:
    """An axis-aligned box in the planning frame.

    Attributes:
        low: Minimum corner, shape (3,) [m].
        high: Maximum corner, shape (3,) [m].
    """

    low: Array
    high: Array

    def extended_by(self, margin: float) -> Region:
        """Returns the region extended by a margin on each side [m]."""
        return Region(self.low - margin, self.high + margin)

    def contains(self, points: Array) -> npt.NDArray[np.bool_]:
        """Returns whether each of the points, shape (n, 3), is inside."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))


def cluster_gap(spacing: float) -> float:
    """Returns the minimum gap between two objects [m] for a point spacing [m]."""
    return max(MIN_GAP_M, GAP_SPACINGS * spacing)


def object_region(target: SceneObject, settings: CloudSettings) -> Region:
    """Returns the region in which the points of an object are searched."""
    points = target.surface.points
    return Region(points.min(axis=0), points.max(axis=0)).extended_by(settings.region_padding_m)


def relevant_region(query: GraspQuery, settings: CloudSettings) -> Region:
    """Returns the region of the relevant points: the object's region, extended by the reach of the approaching hand."""
    hand = max(float(np.linalg.norm(part.corners.reshape(-1, 3), axis=1).max()) for part in query.gripper.parts)
    return object_region(query.target, settings).extended_by(hand + settings.hand.approach_distance_m)


def cloud_grasps(query: GraspQuery, points: Array, settings: CloudSettings) -> list[PairGrasp]:
    """Returns the grasps of an object; deterministic for given points and query.

    Args:
        query: Object with its position, known surroundings, and hand.
        points: Points seen by the camera, without points on the robot, in the planning frame, shape (n, 3) [m].
        settings: Feasibility limits.

    Returns:
        Feasible grasps in the order in which their reachability should be checked.

    Raises:
        NoCandidatesError: The object has no feasible grasp; the message gives the reason.
    """
    generator = np.random.default_rng(query.seed)
    points = downsample_points(points[relevant_region(query, settings).contains(points)])
    support = _support_height(query, points, generator)
    points = points[support.heights(points) > settings.min_height_m]
    points, spacing = _surface_points(query, points, settings)
    own = _own_points(query, points, spacing, settings)
    target_points = points[own]
    support_z = support.z_at(*target_points[:, :2].mean(axis=0).tolist())
    shape = completed_shape(target_points, spacing, support_z)
    seen_object = SceneObject(query.target.name, shape.surface)
    obstacle_points = _columns(points[~own], support_z)
    obstacles = (*query.obstacles, obstacle_points) if obstacle_points else query.obstacles
    seen_query = replace(query, target=seen_object, obstacles=obstacles, support_z=support_z)
    pairs = _sample_pairs(shape, query.gripper, settings, generator)
    grasps = grasps_on_pairs(pairs, seen_query, settings)
    if not grasps:
        raise NoCandidatesError(
            f"{len(pairs)} contact pairs fit the gripper, but in no approach direction does the hand reach one without "
            "contact with the object, the support, other points of the cloud or objects of the scene"
        )
    return grasps


def _support_height(query: GraspQuery, points: Array, generator: np.random.Generator) -> SupportPlane:
    """Returns the support plane in the cloud; if it is not visible, the support of the planning scene."""
    around = points[np.abs(points[:, 2] - query.support_z) <= SUPPORT_SEARCH_M]
    return find_support(around, generator) or SupportPlane(np.array([0.0, 0.0, 1.0]), query.support_z)


def _surface_points(query: GraspQuery, points: Array, settings: CloudSettings) -> tuple[Array, float]:
    """Returns the points above the support without isolated points, and the point spacing on the object [m].

    Raises:
        NoCandidatesError: The object has too few points.
    """
    region = object_region(query.target, settings)
    spacing = point_spacing(points[region.contains(points)])
    points = points[has_neighbours(points, spacing)] if len(points) else points
    point_count = int(region.contains(points).sum())
    if point_count < MIN_POINTS:
        low, high = (", ".join(f"{value:.3f}" for value in end) for end in (region.low, region.high))
        raise NoCandidatesError(
            f"the cloud has {point_count} points on '{query.target.name}', at least {MIN_POINTS} are needed, more than "
            f"{settings.min_height_m * 1000:.0f} mm above its support and off the robot, between ({low}) and "
            f"({high}) m; is the object in view of the camera and not occluded?"
        )
    return points, spacing


def _own_points(query: GraspQuery, points: Array, spacing: float, settings: CloudSettings) -> npt.NDArray[np.bool_]:
    """Returns whether each point above the support belongs to the object.

    These are the points in the object's region, without clusters that extend mostly outside. If too few points remain,
    as for an object in contact with a larger object, all points in the region are returned.
    """
    inside = object_region(query.target, settings).contains(points)
    labels = cluster_labels(points[:, :2], cluster_gap(spacing))
    inside_fractions = np.bincount(labels, weights=inside) / np.bincount(labels)
    own = inside & (inside_fractions[labels] > 0.5)
    return own if own.sum() >= MIN_POINTS else inside


def _sample_pairs(
    shape: SeenShape, gripper: GripperGeometry, settings: CloudSettings, generator: np.random.Generator
) -> list[ContactPair]:
    surface = shape.surface
    is_seen = shape.unseen_m <= gripper.pad_half_height
    widest = settings.widest(gripper)
    found_pairs = sample_pairs(
        surface.points[is_seen],
        surface.normals[is_seen],
        surface.centroid,
        widest,
        settings=settings.pairs,
        generator=generator,
    )
    if found_pairs.pairs:
        return found_pairs.pairs
    opening = (
        f"the gripper opens to {gripper.max_opening * 1000:.0f} mm, of which {widest * 1000:.0f} mm remain with a "
        f"clearance of {settings.hand.min_finger_clearance_m * 1000:.0f} mm on each side"
    )
    if math.isinf(found_pairs.narrowest_m):
        raise NoCandidatesError(
            f"none of {int(is_seen.sum())} visible contacts face each other within the friction cone of "
            f"{settings.pairs.friction:g}; {opening}"
        )
    raise NoCandidatesError(
        f"no contact pair fits: the narrowest is {found_pairs.narrowest_m * 1000:.0f} mm wide, and {opening}"
    )


def _columns(points: Array, support_z: float) -> SceneObject | None:
    """Returns the other visible points as square columns on the support; None without other points."""
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
