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
    """Shows the planning scene in a layer.

    Args:
        layer: Layer of the objects.
        log: Function that logs an object that cannot be drawn.
    """

    def __init__(self, layer: Layer, log: Callable[[str], None]) -> None:
        self._layer, self._log = layer, log
        self._scene = PlanningSceneObjects()
        self._drawn: dict[str, tuple[tuple[PlacedBody, ...], bool]] = {}

    def apply(self, message: Any) -> None:
        """Applies a moveit_msgs/PlanningScene, which is a complete scene or a difference."""
        for fault in self._scene.apply(message):
            self._log(f"planning scene: {fault}")

    def place(self, links_in_world: Mapping[str, Pose]) -> None:
        """Shows the objects at their current poses.

        Args:
            links_in_world: Poses of the robot's links, which may carry objects, in the world frame.
        """
        objects = self._scene.objects
        for name in [name for name in self._drawn if name not in objects]:
            del self._drawn[name]
            self._layer.remove(tree_name(name))
        for name, item in objects.items():
            previous = self._drawn.get(name)
            if previous is None or previous[0] is not item.bodies or previous[1] != item.attached:
                self._drawn[name] = (item.bodies, item.attached)
                colour = ATTACHED_COLOUR if item.attached else FREE_COLOUR
                self._layer.add(tree_name(name), glb_of(item.bodies, colour, _OUTSET_M), Look.GHOST)
            self._layer.place(tree_name(name), links_in_world.get(item.frame, Pose()) @ item.pose)

    def clear(self) -> None:
        """Removes all objects."""
        if self._drawn or self._scene.objects:
            self._scene = PlanningSceneObjects()
            self._drawn.clear()
            self._layer.clear()
