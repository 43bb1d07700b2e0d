# SPDX-License-Identifier: BSD-3-Clause
"""Planning scene interface with serialized messages, as in MoveIt's Python binding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from moveit_commander import planning_scene_interface
from moveit_msgs.msg import PlanningScene

from moveit_ros_planning_interface.serialized import read, write


class PlanningSceneInterface:
    """Reads and changes move_group's scene."""

    def __init__(self, ns: str = "") -> None:
        """Connects to the services of move_group.

        Args:
            ns: Namespace of move_group's services.
        """
        self._scene = planning_scene_interface.PlanningSceneInterface(ns, synchronous=True)

    def get_known_object_names(self, with_type: bool = False) -> list[str]:
        """Returns the names of the world objects; if `with_type`, only of objects with a type."""
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
            with_type: Whether to return only objects with a type.
        """
        return self._scene.get_known_object_names_in_roi(minx, miny, minz, maxx, maxy, maxz, with_type)

    def get_object_poses(self, object_ids: Sequence[str]) -> dict[str, bytes]:
        """Returns geometry_msgs/Pose of objects by name."""
        return _serialized_messages(self._scene.get_object_poses(object_ids))

    def get_objects(self, object_ids: Sequence[str] = ()) -> dict[str, bytes]:
        """Returns moveit_msgs/CollisionObject by name; all world objects if no name is given."""
        return _serialized_messages(self._scene.get_objects(object_ids))

    def get_attached_objects(self, object_ids: Sequence[str] = ()) -> dict[str, bytes]:
        """Returns moveit_msgs/AttachedCollisionObject by name; all attached objects if no name is given."""
        return _serialized_messages(self._scene.get_attached_objects(object_ids))

    def get_planning_scene(self, components: int) -> bytes:
        """Returns a moveit_msgs/PlanningScene with the components given as bits of PlanningSceneComponents."""
        return write(self._scene.get_planning_scene(components))

    def apply_planning_scene(self, planning_scene: bytes) -> bool:
        """Applies a moveit_msgs/PlanningScene to the scene; returns whether move_group applied it."""
        return self._scene.apply_planning_scene(read(PlanningScene, planning_scene))

    def clear(self) -> bool:
        """Removes all world objects and attached objects from the scene; raises if move_group refuses the change."""
        self._scene.clear()
        return True


def _serialized_messages(messages: Mapping[str, Any]) -> dict[str, bytes]:
    return {name: write(message) for name, message in messages.items()}
