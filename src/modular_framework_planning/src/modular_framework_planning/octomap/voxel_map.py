# SPDX-License-Identifier: BSD-3-Clause
"""An occupancy map of voxels, updated from depth sensors.

Occupancy is a log-odds value per voxel, updated and clamped as in Hornung et al., "OctoMap: an efficient probabilistic
3D mapping framework based on octrees", Autonomous Robots 34 (2013), with the constants of their library, so that maps
may be exchanged with it. A map is two flat arrays sorted by Morton code: the order of an octree's leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.octomap.compiled_voxels import cells_of_points, cells_on_rays, distinct, merged

Keys = NDArray[np.int64]  # Morton codes: bits of x, y, z interleaved, x lowest
Values = NDArray[np.float32]

LEVELS = 16  # the tree's depth; an axis has 2**16 voxels
AXIS_CENTER = 1 << (LEVELS - 1)  # voxel that begins at coordinate 0
HIT, MISS, LOWEST, HIGHEST = (
    float(np.float32(np.log(chance / (1.0 - chance)))) for chance in (0.7, 0.4, 0.1192, 0.971)
)
"""Log odds of the chance that a voxel is occupied: steps of a hit and of a miss, lower and upper clamp."""
MAX_VOXELS = 16_000_000


def gather_bits(values: Keys) -> Keys:
    """Moves bit 3i back to bit i; other bits are dropped."""
    packed = values & 0x249249249249
    for shift, mask in ((2, 0x0C30C30C30C3), (4, 0x00F00F00F00F), (8, 0x0000FF0000FF), (16, 0xFFFF)):
        packed = (packed | (packed >> shift)) & mask
    return packed


def cells_of_keys(keys: Keys) -> Keys:
    """Returns the three 16-bit numbers (n, 3) of Morton codes."""
    return np.stack([gather_bits(keys), gather_bits(keys >> 1), gather_bits(keys >> 2)], axis=1)


@dataclass(frozen=True, eq=False)
class VoxelMap:
    """An immutable occupancy map; updates return a new one.

    Attributes:
        resolution: edge length of a voxel [m].
        keys: Morton codes of the known voxels (n,), ascending.
        values: log odds of being occupied (n,).
    """

    resolution: float
    keys: Keys
    values: Values

    def __post_init__(self) -> None:
        if not np.isfinite(self.resolution) or self.resolution < 1.0e-3:
            raise GeometryError(f"octomap resolution: got {self.resolution} m; allowed are lengths of 0.001 m or more")
        if len(self.keys) > MAX_VOXELS:
            raise GeometryError(
                f"octomap: {len(self.keys)} voxels of {self.resolution} m; allowed are {MAX_VOXELS}; "
                "use larger voxels or a shorter max_range"
            )

    @cached_property
    def occupied_keys(self) -> Keys:
        """Codes of the voxels that are more likely occupied than free."""
        return self.keys[self.values > 0.0]

    def occupied_centers(self) -> Array:
        """Returns the centres of the occupied voxels (n, 3) [m]."""
        return self.centers(self.occupied_keys)

    def centers(self, keys: Keys) -> Array:
        """Returns the centres of voxels (n, 3) [m]."""
        return (cells_of_keys(keys) - (AXIS_CENTER - 0.5)).astype(np.float64) * self.resolution

    def keys_of_points(self, points: Array) -> Keys:
        """Returns the codes of the voxels that points (n, 3) [m] lie in; points beyond the tree are left out."""
        return cells_of_points(np.asarray(points, dtype=float).reshape(-1, 3), self.resolution, AXIS_CENTER)

    def updated(self, free: Keys, occupied: Keys, masked: Keys) -> VoxelMap:
        """Returns the map after one point cloud.

        Args:
            free: voxels that rays went through.
            occupied: voxels in which rays ended; they count as occupied even if other rays went through.
            masked: voxels in which rays ended on the robot or on a known object; they become free at once.
        """
        keys = np.concatenate([free, occupied, masked])
        steps = np.repeat(np.array([MISS, HIT, LOWEST - HIGHEST], np.float32), [len(free), len(occupied), len(masked)])
        order = np.argsort(keys, kind="stable")
        keys, steps = keys[order], steps[order]
        last = np.append(keys[1:] != keys[:-1], True)[: len(keys)]  # of several updates of a voxel the strongest
        return VoxelMap(self.resolution, *merged(self.keys, self.values, keys[last], steps[last], LOWEST, HIGHEST))

    def with_point_cloud(self, origin: Array, hits: Array, masked: Array, clipped: Array) -> VoxelMap:
        """Returns the map after a point cloud: rays end at points and clear what they go through.

        Args:
            origin: where the sensor is (3,) [m].
            hits: points on things that are not known otherwise (n, 3) [m].
            masked: points on the robot and on known objects (n, 3) [m].
            clipped: points along rays that ended beyond the sensor's range (n, 3) [m].
        """
        occupied, known, beyond = (distinct(self.keys_of_points(points)) for points in (hits, masked, clipped))
        ends = self.centers(np.concatenate([occupied, known, beyond])) / self.resolution + AXIS_CENTER
        start = np.asarray(origin, dtype=float) / self.resolution + AXIS_CENTER
        if not ((start >= 0.0) & (start < 2 * AXIS_CENTER)).all():
            raise GeometryError(
                f"octomap: the sensor is at {np.round(origin, 2).tolist()} m; a map with voxels of "
                f"{self.resolution} m reaches {AXIS_CENTER * self.resolution:.0f} m in each direction"
            )
        return self.updated(np.sort(cells_on_rays(start, ends)), occupied, known)

    def freed(self, keys: Keys) -> VoxelMap:
        """Returns the map in which the given voxels, where they are known, are free."""
        values = self.values.copy()
        values[np.isin(self.keys, keys, assume_unique=True)] = LOWEST
        return VoxelMap(self.resolution, self.keys, values)


def empty_map(resolution: float) -> VoxelMap:
    """Returns a map in which nothing is known; `resolution` in [m]."""
    return VoxelMap(float(resolution), np.empty(0, np.int64), np.empty(0, np.float32))
