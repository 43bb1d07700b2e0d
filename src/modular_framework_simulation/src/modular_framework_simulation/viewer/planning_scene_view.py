# SPDX-License-Identifier: BSD-3-Clause
"""Draws the objects of the planning scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.viewer.glb_files import PlacedBody, glb_of
from modular_framework_simulation.viewer.layers import Layer, Look, tree_name
from modular_framework_simulation.viewer.planning_scene_objects import (
    ATTACHED_COLOUR,
    FREE_COLOUR,
    PlanningSceneObjects,
)

_OUTSET_M = 0.0015


class PlanningSceneView:
    """The planning scene in a layer.

    Args:
        layer: Where it is drawn.
        log: Takes a line about an object that cannot be drawn.
    """

    def __init__(self, layer: Layer, log: Callable[[str], None]) -> None:
        self._layer, self._log = layer, log
        self._scene = PlanningSceneObjects()
        self._drawn: dict[str, tuple[tuple[PlacedBody, ...], bool]] = {}

    def apply(self, message: Any) -> None:
        """Takes a moveit_msgs/PlanningScene, whole or a change."""
        for fault in self._scene.apply(message):
            self._log(f"planning scene: {fault}")

    def place(self, links_in_world: Mapping[str, Pose]) -> None:
        """Draws the objects where they are now.

        Args:
            links_in_world: Poses of the links of the robot, which may carry objects.
        """
        objects = self._scene.objects
        for name in [name for name in self._drawn if name not in objects]:
            del self._drawn[name]
            self._layer.remove(tree_name(name))
        for name, item in objects.items():
            before = self._drawn.get(name)
            if before is None or before[0] is not item.bodies or before[1] != item.attached:
                self._drawn[name] = (item.bodies, item.attached)
                colour = ATTACHED_COLOUR if item.attached else FREE_COLOUR
                self._layer.add(tree_name(name), glb_of(item.bodies, colour, _OUTSET_M), Look.GHOST)
            self._layer.place(tree_name(name), links_in_world.get(item.frame, Pose()) @ item.pose)

    def clear(self) -> None:
        """Forgets and removes all objects."""
        if self._drawn or self._scene.objects:
            self._scene = PlanningSceneObjects()
            self._drawn.clear()
            self._layer.clear()
