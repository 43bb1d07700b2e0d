# SPDX-License-Identifier: BSD-3-Clause
"""Measures how near a hand comes to the other objects of the scene while it advances to a grasp and closes."""

from __future__ import annotations

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
    """Distances between a hand and the obstacles around an object, exact for their meshes (with Coal).

    Args:
        obstacles: The other objects of the scene.
        gripper: Geometry of the hand.
        limit_m: Greatest distance of interest [m]; obstacles farther away are passed over.
    """

    def __init__(self, obstacles: Sequence[SceneObject], gripper: GripperGeometry, limit_m: float = 0.1) -> None:
        self._gripper, self._limit = gripper, limit_m
        solids = [solid for obstacle in obstacles for solid in obstacle.solids]
        self._bodies = [(_tree(solid), solid.vertices.min(axis=0), solid.vertices.max(axis=0)) for solid in solids]
        self._hulls: dict[tuple[int, int, float], Any] = {}
        corners = np.concatenate([part.corners.reshape(-1, 3) for part in gripper.parts])
        self._radius = float(np.linalg.norm(corners, axis=1).max())

    def of_grasp(
        self, position: Array, hand_axes: Array, openings: tuple[float, float], approach_distance_m: float
    ) -> float:
        """Computes the least distance from the obstacles [m]; 0 when the hand touches one.

        Args:
            position: (3,) the grasp frame at the grasp, in the planning frame [m].
            hand_axes: (3, 3) axes of the hand in the planning frame, as columns: closing, across and approach.
            openings: Free width between the pads while the hand advances, and when they touch the object [m].
            approach_distance_m: How far the hand advances [m].

        Returns:
            The distance, at most the limit.
        """
        start = position - approach_distance_m * hand_axes[:, 2]
        room = self._radius + self._limit
        low, high = np.minimum(start, position) - room, np.maximum(start, position) + room
        near = [body for body, least, most in self._bodies if (least < high).all() and (most > low).all()]
        if not near:
            return self._limit
        advancing, closed = (self._sample(opening) for opening in openings)
        closing = np.unique(np.linspace(advancing, closed, CLOSING_SAMPLES).round().astype(int)).tolist()
        place = coal.Transform3s(hand_axes, position)
        least = self._limit
        for number in range(len(self._gripper.parts)):
            hulls = [self._hull(number, advancing, approach_distance_m)]
            hulls += [self._hull(number, sample, 0.0) for sample in closing if sample != advancing]
            for hull in hulls:
                for body in near:
                    least = min(least, coal.distance(hull, place, body, coal.Transform3s.Identity(),
                                                     coal.DistanceRequest(), coal.DistanceResult()))  # fmt: skip
                    if least <= 0.0:
                        return 0.0
        return float(least)

    def _sample(self, opening: float) -> int:
        return int(np.argmin(np.abs(self._gripper.openings - opening)))

    def _hull(self, part: int, sample: int, sweep: float) -> Any:
        """Returns a part of the hand, swept from so far behind [m], in the frame of the hand."""
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
