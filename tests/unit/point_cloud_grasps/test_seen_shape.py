# SPDX-License-Identifier: BSD-3-Clause
"""Positions and normals of the surface that a camera from above leads to, against those of the shapes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from depth_camera import EYE, LYING, Box, Cylinder, Shape, Sphere, seen, turned  # noqa: E402

from point_cloud_grasps.seen_shape import SeenShape, completed_shape  # noqa: E402
from point_cloud_grasps.segmentation import downsample_points, point_spacing  # noqa: E402

TABLE_M = 0.84
PIXEL_M = 0.0034  # distance of neighbouring points on the table
TABLE = Box((2.0, 2.0, 0.02), (0.0, 0.5, TABLE_M - 0.01))
X, Y = 0.1, 0.5
BOX_SIZE, BOX_YAW = (0.05, 0.07, 0.10), 0.4
OBJECTS: dict[str, Shape] = {
    "box": Box(BOX_SIZE, (X, Y, TABLE_M + 0.05), turned(BOX_YAW)),
    "can": Cylinder(0.033, 0.115, (X, Y, TABLE_M + 0.0575)),
    "lying": Cylinder(0.025, 0.12, (X, Y, TABLE_M + 0.025), LYING),
    "ball": Sphere(0.035, (X, Y, TABLE_M + 0.035)),
}


def shape_of(name: str, noise_m: float = 0.0, share: float = 1.0) -> SeenShape:
    points = seen([TABLE, OBJECTS[name]], noise_m)
    points = points[(np.abs(points[:, :2] - [X, Y]) < 0.1).all(axis=1) & (points[:, 2] > TABLE_M + 0.006)]
    points = downsample_points(np.random.default_rng(2).permutation(points)[: int(share * len(points))])
    return completed_shape(points, point_spacing(points), TABLE_M)


def gaps_and_normals(name: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far points are outside of an object's vertical outline or upper side, its normals, and where both are clear.

    What the camera cannot see counts as filled down to the table.
    """
    shape = OBJECTS[name]
    local = (points - shape.centre) @ shape.axes
    match shape:
        case Box(size=size):
            beyond = np.abs(local) - np.array(size) / 2
            axis = beyond.argmax(axis=1)
            normals = np.zeros_like(local)
            rows = np.arange(len(local))
            normals[rows, axis] = np.sign(local[rows, axis])
            others = np.sort(beyond[:, :2], axis=1)
            clear = np.where(
                axis == 2, others[:, 1] < -2 * PIXEL_M, (others[:, 0] < -2 * PIXEL_M) & (beyond[:, 2] < -2 * PIXEL_M)
            )
            return beyond.max(axis=1), normals @ shape.axes.T, clear
        case Cylinder(radius=radius, height=height) if name == "can":
            around, above = np.linalg.norm(local[:, :2], axis=1) - radius, local[:, 2] - height / 2
            side = around > above
            normals = np.where(side[:, None], np.column_stack([local[:, :2], np.zeros(len(local))]), [0.0, 0.0, 1.0])
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            return np.maximum(around, above), normals, np.minimum(around, above) < -2 * PIXEL_M
        case Cylinder(radius=radius, height=height):
            ring = local[:, :2].copy()
            ring[points[:, 2] < shape.centre[2], 0] = 0.0  # below the axis the walls of the outline
            ring[:, 1] = local[:, 1]
            normals = np.column_stack([ring, np.zeros(len(local))]) / np.linalg.norm(ring, axis=1, keepdims=True)
            return (
                np.linalg.norm(ring, axis=1) - radius,
                normals @ shape.axes.T,
                np.abs(local[:, 2]) < height / 2 - 2 * PIXEL_M,
            )
        case Sphere(radius=radius):
            upper = local * [1.0, 1.0, 0.0] + np.maximum(local, 0.0) * [0.0, 0.0, 1.0]
            lengths = np.linalg.norm(upper, axis=1)
            return lengths - radius, upper / lengths[:, None], np.ones(len(local), dtype=bool)


@pytest.mark.parametrize(("noise_m", "median_deg", "most_deg"), [(0.0, 3.0, 12.0), (0.002, 6.0, 20.0)])
@pytest.mark.parametrize("name", OBJECTS)
def test_points_and_normals_are_those_of_the_object(
    name: str, noise_m: float, median_deg: float, most_deg: float
) -> None:
    surface = shape_of(name, noise_m).surface
    gaps, normals, clear = gaps_and_normals(name, surface.points)
    assert clear.sum() > 200
    gaps = gaps[clear]
    assert abs(np.median(gaps)) < PIXEL_M / 2 + noise_m and np.percentile(np.abs(gaps), 95) < PIXEL_M + 2 * noise_m
    cosines = (surface.normals * normals).sum(axis=1)[clear]
    angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    assert np.median(angles) < median_deg and np.percentile(angles, 95) < most_deg
    assert np.allclose(np.linalg.norm(surface.normals, axis=1), 1.0)


def test_a_tenth_of_the_points_missing_leaves_no_hole() -> None:
    surface = shape_of("box", share=0.9).surface
    top = surface.points[surface.normals[:, 2] > 0.9]
    assert np.percentile(np.abs(top[:, 2] - (TABLE_M + BOX_SIZE[2])), 95) < PIXEL_M


def test_volume_and_centre_of_a_box_are_those_of_the_box() -> None:
    surface = shape_of("box").surface
    assert surface.volume == pytest.approx(np.prod(BOX_SIZE), rel=0.12)
    assert surface.centroid == pytest.approx([X, Y, TABLE_M + BOX_SIZE[2] / 2], abs=0.003)
    assert surface.points[:, 2].min() >= TABLE_M


def test_what_was_not_seen_is_measured_from_the_edge_above_it() -> None:
    shape = shape_of("can")
    points, unseen = shape.surface.points, shape.unseen_m
    walls = np.abs(shape.surface.normals[:, 2]) < 0.1
    hidden = shape.surface.normals[:, :2] @ ([X, Y] - EYE[:2]) > 0.1  # on the far side from the camera
    low = walls & hidden & (points[:, 2] < TABLE_M + 0.05)
    assert low.any() and unseen[low] == pytest.approx(TABLE_M + 0.115 - points[low, 2], abs=2 * PIXEL_M)
    assert unseen[shape.surface.normals[:, 2] > 0.9].max() < PIXEL_M
