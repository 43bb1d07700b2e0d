# SPDX-License-Identifier: BSD-3-Clause
"""An occupancy map of voxels, updated from depth sensors.

Occupancy is a log-odds value per voxel, updated and clamped as in Hornung et al., "OctoMap: an efficient probabilistic
3D mapping framework based on octrees", Autonomous Robots 34 (2013). The constants equal the constants of the OctoMap
library, so that maps are compatible. A map has two flat arrays, sorted by Morton code like the leaves of an octree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.octomap.compiled_voxels import cells_of_points, cells_on_rays, distinct, merge

Keys = NDArray[np.int64]  # Morton codes, with interleaved bits of x, y, z and x lowest
Values = NDArray[np.float32]

LEVELS = 16  # depth of the tree; an axis has 2**16 voxels
AXIS_CENTER = 1 << (LEVELS - 1)  # index of the voxel that begins at coordinate 0
HIT, MISS, LOWEST, HIGHEST = (
    float(np.float32(np.log(probability / (1.0 - probability)))) for probability in (0.7, 0.4, 0.1192, 0.971)
)
"""Log odds of occupancy: update steps of a hit and of a miss, lower and upper clamp."""
MAX_VOXELS = 16_000_000


def gather_bits(values: Keys) -> Keys:
    """Moves bit 3i to bit i and drops all other bits."""
    packed = values & 0x249249249249
    for shift, mask in ((2, 0x0C30C30C30C3), (4, 0x00F00F00F00F), (8, 0x0000FF0000FF), (16, 0xFFFF)):
        packed = (packed | (packed >> shift)) & mask
    return packed


def cells_of_keys(keys: Keys) -> Keys:
    """Returns the three 16-bit voxel indices of Morton codes, shape (n, 3)."""
    return np.stack([gather_bits(keys), gather_bits(keys >> 1), gather_bits(keys >> 2)], axis=1)


@dataclass(frozen=True, eq=False)
class VoxelMap:
    """An immutable occupancy map; updates return new maps.

    Attributes:
        resolution: Edge length of a voxel [m].
        keys: Morton codes of the known voxels in ascending order, shape (n,).
        values: Log odds of occupancy, shape (n,).
    """

    resolution: float
    keys: Keys
    values: Values

    def __post_init__(self) -> None:
        if not np.isfinite(self.resolution) or self.resolution < 1.0e-3:
            raise GeometryError(f"octomap resolution: got {self.resolution} m; give a length of at least 0.001 m")
        if len(self.keys) > MAX_VOXELS:
            raise GeometryError(
                f"octomap: {len(self.keys)} voxels of {self.resolution} m; at most {MAX_VOXELS} are allowed; "
                "use larger voxels or a shorter max_range"
            )

    @cached_property
    def occupied_keys(self) -> Keys:
        """Morton codes of the voxels with positive log odds."""
        return self.keys[self.values > 0.0]

    def occupied_centers(self) -> Array:
        """Returns the centres of the occupied voxels, shape (n, 3) [m]."""
        return self.centers(self.occupied_keys)

    def centers(self, keys: Keys) -> Array:
        """Returns the centres of voxels, shape (n, 3) [m]."""
        return (cells_of_keys(keys) - (AXIS_CENTER - 0.5)).astype(np.float64) * self.resolution

    def keys_of_points(self, points: Array) -> Keys:
        """Returns the codes of the voxels that contain points, shape (n, 3) [m], without points outside the tree."""
        return cells_of_points(np.asarray(points, dtype=float).reshape(-1, 3), self.resolution, AXIS_CENTER)

    def with_cloud(self, free_cells: Keys, occupied_cells: Keys, masked_cells: Keys) -> VoxelMap:
        """Returns the map updated by one point cloud.

        Args:
            free_cells: Voxels along rays.
            occupied_cells: Voxels at the ends of rays; they count as hit even if other rays pass through them.
            masked_cells: Voxels at the ends of rays on the robot or on a known object; they become free at once.
        """
        keys = np.concatenate([free_cells, occupied_cells, masked_cells])
        steps = np.repeat(
            np.array([MISS, HIT, LOWEST - HIGHEST], np.float32),
            [len(free_cells), len(occupied_cells), len(masked_cells)],
        )
        order = np.argsort(keys, kind="stable")
        keys, steps = keys[order], steps[order]
        is_last = np.append(keys[1:] != keys[:-1], True)[: len(keys)]  # the strongest update of each voxel
        return VoxelMap(self.resolution, *merge(self.keys, self.values, keys[is_last], steps[is_last], LOWEST, HIGHEST))

    def with_point_cloud(self, origin: Array, hits: Array, masked_points: Array, clipped: Array) -> VoxelMap:
        """Returns the map updated by rays, which mark the voxels of their end points and clear all voxels before.

        Args:
            origin: Position of the sensor, shape (3,) [m].
            hits: Points on unknown obstacles, shape (n, 3) [m].
            masked_points: Points on the robot and on known objects, shape (n, 3) [m].
            clipped: Points at maximum range on rays that ended beyond, shape (n, 3) [m].
        """
        occupied_cells, known, beyond = (
            distinct(self.keys_of_points(points)) for points in (hits, masked_points, clipped)
        )
        ends = self.centers(np.concatenate([occupied_cells, known, beyond])) / self.resolution + AXIS_CENTER
        start = np.asarray(origin, dtype=float) / self.resolution + AXIS_CENTER
        if not ((start >= 0.0) & (start < 2 * AXIS_CENTER)).all():
            raise GeometryError(
                f"octomap: the sensor is at {np.round(origin, 2).tolist()} m, outside the map; with voxels of "
                f"{self.resolution} m, a map reaches {AXIS_CENTER * self.resolution:.0f} m in each direction"
            )
        return self.with_cloud(np.sort(cells_on_rays(start, ends)), occupied_cells, known)

    def with_free_cells(self, keys: Keys) -> VoxelMap:
        """Returns the map with the given voxels set to free; unknown voxels stay unknown."""
        values = self.values.copy()
        values[np.isin(self.keys, keys, assume_unique=True)] = LOWEST
        return VoxelMap(self.resolution, self.keys, values)


def empty_map(resolution: float) -> VoxelMap:
    """Returns a map without known voxels; `resolution` in [m]."""
    return VoxelMap(float(resolution), np.empty(0, np.int64), np.empty(0, np.float32))
