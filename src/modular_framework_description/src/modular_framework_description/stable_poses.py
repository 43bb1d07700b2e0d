# SPDX-License-Identifier: BSD-3-Clause
"""Computes the stable poses of an object on a horizontal surface, with the probabilities after a drop.

The probability of a pose is the fraction of the directions, seen from the centre of mass, in which the object topples
into the pose without inertia (Goldberg et al., Part pose statistics, IEEE Trans. Robotics and Automation 15(5), 1999).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from modular_framework_core.grasp_generation.convex_bodies import convex_hull

Array = npt.NDArray[np.float64]

MAX_FACES, TOLERANCE = 1000, 0.004
"""Maximum number of faces of an exact hull, and tolerance of a coarse hull as a fraction of the longest side."""


@dataclass(frozen=True, slots=True)
class StablePose:
    """Orientation in which an object stands on a horizontal surface, at any yaw.

    Attributes:
        roll: Roll angle of the object [rad].
        pitch: Pitch angle of the object [rad].
        height: Height of the object frame above the surface [m].
        probability: Probability of the pose after a drop at a random orientation.
    """

    roll: float
    pitch: float
    height: float
    probability: float

    @property
    def rotation(self) -> Array:
        """Returns the rotation matrix from the object frame to the world frame at yaw 0, shape (3, 3)."""
        (cr, sr), (cp, sp) = ((math.cos(angle), math.sin(angle)) for angle in (self.roll, self.pitch))
        return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])


def stable_poses(vertices: Array, centre: Array) -> tuple[StablePose, ...]:
    """Returns the stable poses of an object, the most probable first.

    Args:
        vertices: Points whose convex hull is the hull of the object, in its frame, shape (n, 3) [m].
        centre: Centre of mass in the frame of the object, inside the hull, shape (3,) [m].
    """
    hull = _hull(np.asarray(vertices))
    poses: Any = trimesh.poses
    transforms, probabilities = poses.compute_stable_poses(hull, center_mass=centre, sigma=0.0, n_samples=1, seed=1)
    return tuple(
        _pose(np.asarray(transform)[2, :3], np.asarray(hull.vertices), float(probability))
        for transform, probability in zip(transforms, probabilities, strict=True)
    )


def _hull(vertices: Array) -> trimesh.Trimesh:
    """Returns the convex hull of points; the hull of a rounded object with fewer faces, which takes less time."""
    hull = trimesh.convex.convex_hull(vertices)
    if len(hull.faces) <= MAX_FACES:
        return hull
    coarse = convex_hull(vertices, TOLERANCE * float(np.ptp(vertices, axis=0).max()))
    return trimesh.convex.convex_hull(coarse.corners)


def _pose(up: Array, vertices: Array, probability: float) -> StablePose:
    """Returns the pose in which a direction of the object frame points up.

    Args:
        up: Unit vector in the object frame.
        vertices: Corners of the hull, shape (n, 3) [m].
        probability: Probability of the pose.
    """
    x, y, z = (round(value, 9) + 0.0 for value in up.tolist())
    roll = math.atan2(y, z)
    pitch = math.atan2(-x, math.hypot(y, z)) + 0.0
    return StablePose(roll, pitch, float(-(vertices @ up).min()), probability)
