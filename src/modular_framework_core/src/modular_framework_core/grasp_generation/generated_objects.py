# SPDX-License-Identifier: BSD-3-Clause
"""Remembers the objects for which grasps were generated, with their poses, to detect moved objects."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject

MOVED_M = 0.005
"""Displacement of a surface point that makes grasps stale: about half the clearance between pad and object."""
REST_M = 0.001
"""Maximum displacement of a surface point of an object at rest between two readings of the scene."""


def same_place(one: SceneObject, other: SceneObject, tolerance_m: float) -> bool:
    """Returns whether two readings of an object have the same surface points within a tolerance.

    Args:
        one: First reading.
        other: Second reading.
        tolerance_m: Maximum displacement of a point along an axis [m].
    """
    if one.name != other.name or one.surface.points.shape != other.surface.points.shape:
        return False
    return bool(np.abs(one.surface.points - other.surface.points).max() <= tolerance_m)


def at_rest(before: Sequence[SceneObject], now: Sequence[SceneObject]) -> bool:
    """Returns whether two readings of the scene contain the same objects at the same poses."""
    return len(before) == len(now) and all(
        same_place(one, other, REST_M) for one, other in zip(before, now, strict=True)
    )


class GeneratedObjects:
    """Objects for which grasps were generated, with their poses at that time."""

    def __init__(self) -> None:
        self._objects: dict[str, SceneObject] = {}

    def mark(self, objects: Iterable[SceneObject]) -> None:
        """Marks the generation for objects at their current poses as finished, with or without grasps."""
        self._objects.update({found.name: found for found in objects})

    def keep(self, names: Collection[str]) -> None:
        """Forgets all other objects; an object that reappears under the same name then counts as new."""
        self._objects = {name: found for name, found in self._objects.items() if name in names}

    def stale(self, objects: Iterable[SceneObject]) -> list[SceneObject]:
        """Returns the objects that are new or have moved."""
        return [
            found
            for found in objects
            if found.name not in self._objects or not same_place(found, self._objects[found.name], MOVED_M)
        ]
