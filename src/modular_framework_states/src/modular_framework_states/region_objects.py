# SPDX-License-Identifier: BSD-3-Clause
"""Selects the objects of a region one after the other, such as the objects on a table that is cleared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_core.managers.acm import LINK_SEPARATOR
from modular_framework_states.place_poses import TargetRegion


def objects_in_region(objects: Iterable[SceneObject], region: TargetRegion) -> list[str]:
    """Returns the models with the centre of their box in a region, the highest upper end first.

    Args:
        objects: Objects of the planning scene, one per link of a model.
        region: Region in the planning frame.
    """
    inside = [item for item in objects if region.contains(item.centre)]
    ranked = sorted(inside, key=lambda item: (-round(float(item.surface.points[:, 2].max()), 3), item.name))
    return list(dict.fromkeys(item.name.partition(LINK_SEPARATOR)[0] for item in ranked))


class ObjectSelection:
    """Selects the least often selected object; the counts restart at 0 once fewer objects are left.

    Args:
        max_selections: Maximum number of selections of an object while no object leaves.
    """

    def __init__(self, max_selections: int) -> None:
        self._max_selections = max_selections
        self._selections: Counter[str] = Counter()
        self._fewest: int | None = None

    def next_of(self, names: Sequence[str]) -> str | None:
        """Returns the next object; None after the last selection of every object.

        Args:
            names: Objects that are left, the preferred object first.
        """
        if self._fewest is None or len(names) < self._fewest:
            self._fewest = len(names)
            self._selections.clear()
        selected = min(names, key=lambda name: self._selections[name], default=None)
        if selected is None or self._selections[selected] >= self._max_selections:
            return None
        self._selections[selected] += 1
        return selected
