# SPDX-License-Identifier: BSD-3-Clause
"""Layers of the scene in the browser, each a group of shapes that are shown and hidden together."""

from __future__ import annotations

from enum import Enum
from typing import Any

from modular_framework_simulation.models.poses import Pose

_MIN_TRANSLATION_M, _MIN_ROTATION_RAD = 1e-5, 1e-4
"""Minimum translation and rotation of a movement that is sent."""


class Look(Enum):
    """Role of a shape in shadows; the value is viser's setting for received shadows."""

    SOLID = True
    """Shape that casts shadows, and receives shadows with the darkness of the light."""
    GROUND = 0.3
    """Shape that receives weak shadows and casts none, which would appear as stripes on its own surface."""
    GHOST = False
    """Transparent shape without shadows."""


class Layer:
    """Shapes below a node of the scene tree.

    Args:
        server: The viser server.
        name: Name of the node.
        visible: Whether the layer is initially visible.
    """

    def __init__(self, server: Any, name: str, visible: bool = True) -> None:
        self._server, self._name = server, name
        self._root = server.scene.add_frame(f"/{name}", show_axes=False, visible=visible)
        self._groups: dict[str, Any] = {}
        self._nodes: dict[str, Any] = {}
        self._poses: dict[str, Pose] = {}

    @property
    def visible(self) -> bool:
        """Returns whether the layer is visible."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        if self._root.visible != visible:
            self._root.visible = visible

    @property
    def paths(self) -> tuple[str, ...]:
        """Returns the paths of all shapes."""
        return tuple(self._nodes)

    def add(self, path: str, content: bytes | None, look: Look = Look.SOLID) -> None:
        """Adds a shape, or replaces the shape with the same path.

        Args:
            path: Name of the shape, or names of a group and a shape, separated by a slash.
            content: Binary glTF; None for a shape that is not visible.
            look: Role in shadows.
        """
        self.remove(path)
        if content is None:
            return
        group, _, shape_name = path.partition("/")
        if shape_name and group not in self._groups:
            self._groups[group] = self._server.scene.add_frame(f"/{self._name}/{group}", show_axes=False)
        self._nodes[path] = self._server.scene.add_glb(
            f"/{self._name}/{path}", content, cast_shadow=look is Look.SOLID, receive_shadow=look.value
        )

    def remove(self, path: str) -> None:
        """Removes a shape, and its group if that is empty; a missing shape is ignored."""
        node = self._nodes.pop(path, None)
        self._poses.pop(path, None)
        if node is None:
            return
        node.remove()
        group = path.partition("/")[0]
        if group in self._groups and not any(other.startswith(f"{group}/") for other in self._nodes):
            self._groups.pop(group).remove()

    def clear(self) -> None:
        """Removes all shapes."""
        for path in self.paths:
            self.remove(path)

    def place(self, path: str, pose: Pose) -> None:
        """Moves a shape to a pose in the world frame; a missing shape is ignored."""
        node, previous = self._nodes.get(path), self._poses.get(path)
        if node is None:
            return
        if previous is not None:
            translation, rotation = previous.distance_to(pose)
            if translation < _MIN_TRANSLATION_M and rotation < _MIN_ROTATION_RAD:
                return
        self._poses[path] = pose
        x, y, z, w = pose.quaternion
        node.position, node.wxyz = pose.position, (w, x, y, z)


def tree_name(name: str) -> str:
    """Returns a name for the scene tree, in which a slash separates names."""
    return name.replace("/", "|") or "(no name)"
