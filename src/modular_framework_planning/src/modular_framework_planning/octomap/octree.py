# SPDX-License-Identifier: BSD-3-Clause
"""The shape of an octomap, for scenes and collision checks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import coal

from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.octomap.voxel_map import VoxelMap


@dataclass(frozen=True, eq=False)
class Octree(Shape):
    """The occupied voxels of a map as axis-aligned cubes."""

    voxels: VoxelMap

    @cached_property
    def centers(self) -> Array:
        """Centres of the occupied voxels, shape (n, 3) [m]."""
        return self.voxels.occupied_centers()

    @property
    def resolution(self) -> float:
        """Edge length of a voxel [m]."""
        return self.voxels.resolution

    def _build(self) -> Any:
        return coal.makeOctree(self.centers, self.resolution)
