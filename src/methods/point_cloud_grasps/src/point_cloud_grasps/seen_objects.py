# SPDX-License-Identifier: BSD-3-Clause
"""Finds what stands on a support in a cloud, for a planning scene that does not know of any object."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox, SceneObject
from modular_framework_core.grasp_generation.surface_points import Surface
from point_cloud_grasps.cloud_grasps import CloudSettings, Region, gap_between_things
from point_cloud_grasps.segmentation import clusters, find_support, has_neighbours, point_spacing, thinned

Array = npt.NDArray[np.float64]

NAME = "seen_{}"
BELOW_M = 0.05
"""The support may be so far below the crop box, which is usually made to begin above it."""
FEWEST_POINTS = 20


def region_of_crop(crop: CropBox) -> Region:
    """Returns where points of objects in the crop box, and of what these stand on, may be."""
    return Region(np.array(crop.low) - [0.0, 0.0, BELOW_M], np.array(crop.high))


def seen_objects(points: Array, crop: CropBox, settings: CloudSettings, seed: int) -> list[SceneObject]:
    """Finds the clusters of points on the support whose middle is in the crop box, those with most points first.

    Args:
        points: (n, 3) what the camera sees in the planning frame, none of them on the robot [m].
        crop: Where objects are looked for.
        settings: What counts as the support, and what as one object.
        seed: Seed of every random choice.

    Returns:
        Objects called `seen_1`, `seen_2`, ... whose surfaces are the points, and below them the support.

    Raises:
        NoCandidatesError: There is no support, or nothing on it.
    """
    points = thinned(points[region_of_crop(crop).hold(points)])
    support = find_support(points, np.random.default_rng(seed))
    if support is None:
        raise NoCandidatesError(
            f"the cloud shows no level plane in the crop box from {crop.low} to {crop.high} m and {BELOW_M} m below "
            f"it ({len(points)} points); correct min_x_crop ... max_z_crop, or the pose of the camera"
        )
    points = points[support.heights(points) > settings.min_height_m]
    spacing = point_spacing(points)
    points = points[has_neighbours(points, spacing)] if len(points) else points
    labels = clusters(points[:, :2], gap_between_things(spacing)) if len(points) else np.zeros(0, dtype=np.int64)
    groups = [points[labels == label] for label in range(int(labels.max(initial=-1)) + 1)]
    groups = [each for each in groups if len(each) >= FEWEST_POINTS and crop.holds(each.mean(axis=0))]
    if not groups:
        raise NoCandidatesError(
            f"nothing of at least {FEWEST_POINTS} points and {settings.min_height_m * 1000:.0f} mm stands on the plane "
            f"at {support.offset:.3f} m that the cloud shows in the crop box"
        )
    groups.sort(key=lambda each: (-len(each), *each.mean(axis=0).tolist()))
    return [_object(NAME.format(number), each, support.normal, support.offset) for number, each in enumerate(groups, 1)]


def _object(name: str, points: Array, normal: Array, offset: float) -> SceneObject:
    feet = points - (points @ normal - offset)[:, None] * normal
    both = np.vstack([points, feet])
    volume = float(np.prod(np.ptp(both, axis=0)))
    return SceneObject(name, Surface(both, np.zeros_like(both), volume, both.mean(axis=0), np.zeros((0, 3))))
