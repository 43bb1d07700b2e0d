# SPDX-License-Identifier: BSD-3-Clause
"""Computes the distance between a hand and the obstacles during the approach and while the hand closes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

CLOSING_SAMPLES = 4


class ObstacleClearance:
    """Distances between a hand and the meshes of obstacles, computed by Coal.

    Args:
        obstacles: All objects of the scene except the target.
        gripper: Geometry of the hand.
        limit_m: Maximum distance of interest [m]; obstacles beyond this distance are ignored.

    Attributes:
        collisions: Number of checked grasps that collide with each obstacle, by name; a grasp counts once.
    """

    def __init__(self, obstacles: Sequence[SceneObject], gripper: GripperGeometry, limit_m: float = 0.1) -> None:
        self._gripper, self._limit = gripper, limit_m
        self.collisions: Counter[str] = Counter()
        self._bodies = [
            (obstacle.name, _tree(solid), solid.vertices.min(axis=0), solid.vertices.max(axis=0))
            for obstacle in obstacles
            for solid in obstacle.solids
        ]
        self._hulls: dict[tuple[int, int, float], Any] = {}
        corners = np.concatenate([part.corners.reshape(-1, 3) for part in gripper.parts])
        self._radius = float(np.linalg.norm(corners, axis=1).max())

    def grasp_clearance(
        self, position: Array, hand_axes: Array, openings: tuple[float, float], approach_distance_m: float
    ) -> float:
        """Returns the distance between the hand and the nearest obstacle, at most the limit [m]; 0 in collision.

        Args:
            position: Position of the grasp frame in the planning frame, shape (3,) [m].
            hand_axes: Axes of the hand in the planning frame, as columns: closing, across, approach; shape (3, 3).
            openings: Free width between the pads during the approach, and at contact [m].
            approach_distance_m: Length of the approach [m].
        """
        start = position - approach_distance_m * hand_axes[:, 2]
        reach = self._radius + self._limit
        low, high = np.minimum(start, position) - reach, np.maximum(start, position) + reach
        near = [
            (name, body) for name, body, lower, upper in self._bodies if (lower < high).all() and (upper > low).all()
        ]
        if not near:
            return self._limit
        advancing, closed = (self._sample(opening) for opening in openings)
        closing = np.unique(np.linspace(advancing, closed, CLOSING_SAMPLES).round().astype(int)).tolist()
        pose = coal.Transform3s(hand_axes, position)
        min_distance = self._limit
        for index in range(len(self._gripper.parts)):
            hulls = [self._hull(index, advancing, approach_distance_m)]
            hulls += [self._hull(index, sample, 0.0) for sample in closing if sample != advancing]
            for hull in hulls:
                for name, body in near:
                    distance = coal.distance(hull, pose, body, coal.Transform3s.Identity(),
                                             coal.DistanceRequest(), coal.DistanceResult())  # fmt: skip
                    min_distance = min(min_distance, distance)
                    if min_distance <= 0.0:
                        self.collisions[name] += 1
                        return 0.0
        return float(min_distance)

    def _sample(self, opening: float) -> int:
        return int(np.argmin(np.abs(self._gripper.openings - opening)))

    def _hull(self, part: int, sample: int, sweep: float) -> Any:
        """Returns the convex hull of a part of the hand, swept over the last `sweep` [m] of the approach."""
        key = (part, sample, sweep)
        if key not in self._hulls:
            corners = self._gripper.parts[part].corners[sample]
            points = coal.StdVec_Vec3s()
            for point in np.concatenate([corners, corners - [0.0, 0.0, sweep]]) if sweep else corners:
                points.append(point)
            self._hulls[key] = coal.Convex.convexHull(points, True, "Qt")
        return self._hulls[key]


def _tree(mesh: TriangleMesh) -> Any:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.triangles), len(mesh.vertices))
    model.addVertices(np.asarray(mesh.vertices, dtype=float))
    model.addTriangles(np.asarray(mesh.triangles, dtype=np.int64))
    model.endModel()
    return model
