# SPDX-License-Identifier: BSD-3-Clause
"""Segments the objects on a support in a cloud, for a planning scene without objects."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox, SceneObject
from modular_framework_core.grasp_generation.surface_points import Surface
from point_cloud_grasps.cloud_grasps import CloudSettings, Region, cluster_gap
from point_cloud_grasps.segmentation import (
    cluster_labels,
    downsample_points,
    find_support,
    has_neighbours,
    point_spacing,
)

Array = npt.NDArray[np.float64]

NAME = "seen_{}"
MAX_SUPPORT_DEPTH_M = 0.05
"""Maximum depth of the support below the crop box, which usually starts above the support."""
MIN_POINTS = 20


def crop_region(crop: CropBox) -> Region:
    """Returns the region of the points of objects in the crop box and of their support."""
    return Region(np.array(crop.low) - [0.0, 0.0, MAX_SUPPORT_DEPTH_M], np.array(crop.high))


def seen_objects(points: Array, crop: CropBox, settings: CloudSettings, seed: int) -> list[SceneObject]:
    """Returns the point clusters on the support whose centre is in the crop box, the largest first.

    Args:
        points: Points seen by the camera, without points on the robot, in the planning frame, shape (n, 3) [m].
        crop: Crop box in which objects are searched.
        settings: Settings of the support and the clusters.
        seed: Seed of the random number generator.

    Returns:
        Objects named `seen_1`, `seen_2`, ..., whose surfaces are the points and their projections onto the support.

    Raises:
        NoCandidatesError: The cloud has no support plane or no object on it.
    """
    points = downsample_points(points[crop_region(crop).contains(points)])
    support = find_support(points, np.random.default_rng(seed))
    if support is None:
        raise NoCandidatesError(
            f"the cloud shows no level plane in the crop box from {crop.low} to {crop.high} m and "
            f"{MAX_SUPPORT_DEPTH_M} m below ({len(points)} points); correct min_x_crop ... max_z_crop or the pose"
        )
    points = points[support.heights(points) > settings.min_height_m]
    spacing = point_spacing(points)
    points = points[has_neighbours(points, spacing)] if len(points) else points
    labels = cluster_labels(points[:, :2], cluster_gap(spacing)) if len(points) else np.zeros(0, dtype=np.int64)
    groups = [points[labels == label] for label in range(int(labels.max(initial=-1)) + 1)]
    groups = [each for each in groups if len(each) >= MIN_POINTS and crop.holds(each.mean(axis=0))]
    if not groups:
        raise NoCandidatesError(
            f"no cluster of at least {MIN_POINTS} points and {settings.min_height_m * 1000:.0f} mm height is on the "
            f"plane at {support.offset:.3f} m in the crop box"
        )
    groups.sort(key=lambda each: (-len(each), *each.mean(axis=0).tolist()))
    return [_object(NAME.format(number), each, support.normal, support.offset) for number, each in enumerate(groups, 1)]


def _object(name: str, points: Array, normal: Array, offset: float) -> SceneObject:
    feet = points - (points @ normal - offset)[:, None] * normal
    both = np.vstack([points, feet])
    volume = float(np.prod(np.ptp(both, axis=0)))
    return SceneObject(name, Surface(both, np.zeros_like(both), volume, both.mean(axis=0), np.zeros((0, 3))))
