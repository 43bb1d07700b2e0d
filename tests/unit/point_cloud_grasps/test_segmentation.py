# SPDX-License-Identifier: BSD-3-Clause
"""The support is found under clutter and noise, and points are told apart by the gaps between them."""

from __future__ import annotations

import numpy as np
import pytest

from point_cloud_grasps.segmentation import (
    cluster_labels,
    downsample_points,
    find_support,
    has_neighbours,
    point_spacing,
)

GENERATOR = np.random.default_rng(1)


def grid(size: float = 0.4, step: float = 0.004) -> np.ndarray:
    x, y = np.meshgrid(np.arange(0.0, size, step), np.arange(0.0, size, step))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


@pytest.mark.parametrize("tilt", [0.0, 0.05, -0.1])
def test_a_plane_is_found_among_noise_and_things_on_it(tilt: float) -> None:
    table = grid()
    table[:, 2] = 0.8 + tilt * table[:, 0] + GENERATOR.normal(0.0, 0.001, len(table))
    clutter = GENERATOR.uniform([0.1, 0.1, 0.81], [0.3, 0.3, 0.9], (len(table) // 3, 3))
    plane = find_support(np.vstack([table, clutter]), np.random.default_rng(3))
    assert plane is not None
    expected = np.array([-tilt, 0.0, 1.0]) / np.hypot(1.0, tilt)
    assert np.degrees(np.arccos(plane.normal @ expected)) < 0.5
    assert plane.z_at(0.2, 0.2) == pytest.approx(0.8 + 0.2 * tilt, abs=0.001)
    assert plane.heights(np.array([[0.2, 0.2, 0.9 + 0.2 * tilt]]))[0] == pytest.approx(0.1, abs=0.002)


def test_there_is_no_plane_in_two_points_nor_in_a_wall() -> None:
    assert find_support(grid()[:2], np.random.default_rng(1)) is None
    wall = grid()[:, [0, 2, 1]]
    assert find_support(wall, np.random.default_rng(1)) is None


def test_the_seed_decides_which_plane_is_found() -> None:
    points = grid() + GENERATOR.normal(0.0, 0.003, (10000, 3))
    one, same = (find_support(points, np.random.default_rng(5)) for _ in range(2))
    assert one is not None and same is not None
    assert one.offset == same.offset and np.array_equal(one.normal, same.normal)


def test_clusters_are_what_no_gap_divides() -> None:
    points = np.vstack([grid(0.04), grid(0.04) + [0.06, 0.0, 0.0], grid(0.04) + [0.0, 0.0, 0.1]])
    labels = cluster_labels(points, 0.01)
    assert [len(set(labels[start : start + 100])) for start in (0, 100, 200)] == [1, 1, 1]
    assert len(set(labels)) == 3
    assert len(set(cluster_labels(points, 0.03))) == 2


def test_a_point_alone_has_no_neighbours_and_the_others_have() -> None:
    points = np.vstack([grid(0.04), [[0.02, 0.02, 0.05]]])
    assert point_spacing(points) == pytest.approx(0.004)
    assert has_neighbours(points, 0.004).tolist() == [True] * 100 + [False]


def test_points_are_thinned_to_one_in_a_cube_at_their_middle() -> None:
    points = np.array([[0.0002, 0.0, 0.0], [0.0012, 0.001, 0.0], [0.0042, 0.0, 0.0]])
    assert sorted(downsample_points(points).tolist()) == [
        [pytest.approx(0.0007), pytest.approx(0.0005), 0.0],
        [pytest.approx(0.0042), 0.0, 0.0],
    ]
