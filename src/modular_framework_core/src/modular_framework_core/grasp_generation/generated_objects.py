# SPDX-License-Identifier: BSD-3-Clause
"""Stores the objects for which grasps were generated with their poses, so that moved objects are detected."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject

MOVED_M = 0.005
"""A surface point farther than this from where it was makes grasps of the object stale: about half the room between
pad and object on the way down."""
REST_M = 0.001


def same_place(one: SceneObject, other: SceneObject, tolerance_m: float) -> bool:
    """Returns whether two views of an object agree: they have the same surface points within a tolerance.

    Args:
        one: First view.
        other: Second view.
        tolerance_m: Largest distance of a point along an axis [m].
    """
    if one.name != other.name or one.surface.points.shape != other.surface.points.shape:
        return False
    return bool(np.abs(one.surface.points - other.surface.points).max() <= tolerance_m)


def at_rest(before: Sequence[SceneObject], now: Sequence[SceneObject]) -> bool:
    """Returns whether the same objects are seen twice, at the same poses."""
    return len(before) == len(now) and all(
        same_place(one, other, REST_M) for one, other in zip(before, now, strict=True)
    )


class GeneratedObjects:
    """The objects for which grasps were generated, where they were then."""

    def __init__(self) -> None:
        self._objects: dict[str, SceneObject] = {}

    def mark(self, objects: Iterable[SceneObject]) -> None:
        """Marks objects as done at their present poses: grasps were generated, or none can be."""
        self._objects.update({found.name: found for found in objects})

    def keep(self, names: Collection[str]) -> None:
        """Drops all objects but these: one that comes back under its name is a new one."""
        self._objects = {name: found for name, found in self._objects.items() if name in names}

    def stale(self, objects: Iterable[SceneObject]) -> list[SceneObject]:
        """Returns the objects that are new, or not where they were."""
        return [
            found
            for found in objects
            if found.name not in self._objects or not same_place(found, self._objects[found.name], MOVED_M)
        ]
