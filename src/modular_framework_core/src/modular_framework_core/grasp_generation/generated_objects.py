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


def same_place(first: SceneObject, second: SceneObject, tolerance_m: float) -> bool:
    """Returns whether two readings of an object have the same surface points within a tolerance.

    Args:
        first: First reading.
        second: Second reading.
        tolerance_m: Maximum displacement of a point along an axis [m].
    """
    if first.name != second.name or first.surface.points.shape != second.surface.points.shape:
        return False
    return bool(np.abs(first.surface.points - second.surface.points).max() <= tolerance_m)


def at_rest(before: Sequence[SceneObject], now: Sequence[SceneObject]) -> bool:
    """Returns whether two readings of the scene contain the same objects at the same poses."""
    return len(before) == len(now) and all(
        same_place(earlier, later, REST_M) for earlier, later in zip(before, now, strict=True)
    )


class GeneratedObjects:
    """Objects for which grasps were generated, with their poses at that time."""

    def __init__(self) -> None:
        self._objects: dict[str, SceneObject] = {}

    def mark(self, objects: Iterable[SceneObject]) -> None:
        """Stores the objects and their current poses after a generation, which may have found no grasps."""
        self._objects.update({scene_object.name: scene_object for scene_object in objects})

    def keep(self, names: Collection[str]) -> None:
        """Forgets all other objects; an object that reappears under the same name then counts as new."""
        self._objects = {name: scene_object for name, scene_object in self._objects.items() if name in names}

    def stale(self, objects: Iterable[SceneObject]) -> list[SceneObject]:
        """Returns the objects that are new or have moved."""
        return [
            scene_object
            for scene_object in objects
            if scene_object.name not in self._objects
            or not same_place(scene_object, self._objects[scene_object.name], MOVED_M)
        ]
