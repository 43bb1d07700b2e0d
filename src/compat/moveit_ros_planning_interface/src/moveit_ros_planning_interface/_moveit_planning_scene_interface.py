# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene with messages as bytes, as MoveIt's binding offers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from moveit_commander import planning_scene_interface
from moveit_msgs.msg import PlanningScene

from moveit_ros_planning_interface.serialized import read, write


class PlanningSceneInterface:
    """Reads and changes move_group's scene."""

    def __init__(self, ns: str = "") -> None:
        """Args: ns: namespace of move_group's services."""
        self._scene = planning_scene_interface.PlanningSceneInterface(ns, synchronous=True)

    def get_known_object_names(self, with_type: bool = False) -> list[str]:
        """Returns the names of the world's objects; with_type: only those with a type."""
        return self._scene.get_known_object_names(with_type)

    def get_known_object_names_in_roi(
        self, minx: float, miny: float, minz: float, maxx: float, maxy: float, maxz: float, with_type: bool = False
    ) -> list[str]:
        """Returns the names of the objects in a box of the planning frame.

        Args:
            minx: Lower bound along x [m].
            miny: Lower bound along y [m].
            minz: Lower bound along z [m].
            maxx: Upper bound along x [m].
            maxy: Upper bound along y [m].
            maxz: Upper bound along z [m].
            with_type: Whether only objects with a type count.
        """
        return self._scene.get_known_object_names_in_roi(minx, miny, minz, maxx, maxy, maxz, with_type)

    def get_object_poses(self, object_ids: Sequence[str]) -> dict[str, bytes]:
        """Returns geometry_msgs/Pose of objects by name."""
        return _serialized(self._scene.get_object_poses(object_ids))

    def get_objects(self, object_ids: Sequence[str] = ()) -> dict[str, bytes]:
        """Returns moveit_msgs/CollisionObject by name; none named: all of them."""
        return _serialized(self._scene.get_objects(object_ids))

    def get_attached_objects(self, object_ids: Sequence[str] = ()) -> dict[str, bytes]:
        """Returns moveit_msgs/AttachedCollisionObject by name; none named: all of them."""
        return _serialized(self._scene.get_attached_objects(object_ids))

    def get_planning_scene(self, components: int) -> bytes:
        """Returns parts of the scene (moveit_msgs/PlanningScene): bits of moveit_msgs/PlanningSceneComponents."""
        return write(self._scene.get_planning_scene(components))

    def apply_planning_scene(self, planning_scene: bytes) -> bool:
        """Changes the scene by a moveit_msgs/PlanningScene; returns whether move_group applied it."""
        return self._scene.apply_planning_scene(read(PlanningScene, planning_scene))

    def clear(self) -> bool:
        """Takes every object out of the scene, attached ones too; raises if move_group refuses it."""
        self._scene.clear()
        return True


def _serialized(messages: Mapping[str, Any]) -> dict[str, bytes]:
    return {name: write(message) for name, message in messages.items()}
