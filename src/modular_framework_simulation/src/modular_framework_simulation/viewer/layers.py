# SPDX-License-Identifier: BSD-3-Clause
"""Layers of the scene in the browser: groups of shapes that are shown and hidden together."""

from __future__ import annotations

from enum import Enum
from typing import Any

from modular_framework_simulation.models.poses import Pose

_SAME_TRANSLATION_M, _SAME_ROTATION_RAD = 1e-5, 1e-4
"""What moved less is not sent again."""


class Look(Enum):
    """How a shape takes part in shadows; the value is how it shows those of others."""

    SOLID = True
    """Casts shadows, and shows them as the light has it."""
    GROUND = 0.3
    """Shows shadows so dark, and casts none: it would cast stripes on itself."""
    GHOST = False
    """Transparent: has nothing to do with them."""


class Layer:
    """Shapes below one node of the object tree.

    Args:
        server: The viser server.
        name: Of the node.
        visible: Whether it is shown at first.
    """

    def __init__(self, server: Any, name: str, visible: bool = True) -> None:
        self._server, self._name = server, name
        self._root = server.scene.add_frame(f"/{name}", show_axes=False, visible=visible)
        self._groups: dict[str, Any] = {}
        self._nodes: dict[str, Any] = {}
        self._poses: dict[str, Pose] = {}

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, visible: bool) -> None:
        if self._root.visible != visible:
            self._root.visible = visible

    @property
    def paths(self) -> tuple[str, ...]:
        """Which shapes there are."""
        return tuple(self._nodes)

    def add(self, path: str, content: bytes | None, look: Look = Look.SOLID) -> None:
        """Adds a shape, in the place of the one that has its path.

        Args:
            path: Names of a group and of the shape in it, with a slash between them; or only a name.
            content: Binary glTF; None: nothing is seen of it.
            look: How it takes part in shadows.
        """
        self.remove(path)
        if content is None:
            return
        group, _, rest = path.partition("/")
        if rest and group not in self._groups:
            self._groups[group] = self._server.scene.add_frame(f"/{self._name}/{group}", show_axes=False)
        self._nodes[path] = self._server.scene.add_glb(
            f"/{self._name}/{path}", content, cast_shadow=look is Look.SOLID, receive_shadow=look.value
        )

    def remove(self, path: str) -> None:
        """Removes a shape, and its group if that is empty then; there may be none."""
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
        """Puts a shape at a pose in the world; nothing where there is no such shape."""
        node, before = self._nodes.get(path), self._poses.get(path)
        if node is None:
            return
        if before is not None:
            translation, rotation = before.distance_to(pose)
            if translation < _SAME_TRANSLATION_M and rotation < _SAME_ROTATION_RAD:
                return
        self._poses[path] = pose
        x, y, z, w = pose.quaternion
        node.position, node.wxyz = pose.position, (w, x, y, z)


def tree_name(name: str) -> str:
    """Returns a name as one of the object tree, where a slash separates names."""
    return name.replace("/", "|") or "(no name)"
