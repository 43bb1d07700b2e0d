# SPDX-License-Identifier: BSD-3-Clause
"""A fake of move_group's planning scene."""

from __future__ import annotations

import threading
from typing import Any

import rospy
from moveit_msgs.msg import CollisionObject
from moveit_msgs.srv import ApplyPlanningScene, ApplyPlanningSceneResponse, GetPlanningScene, GetPlanningSceneResponse


class FakePlanningScene:
    """A fake of move_group that stores what it receives."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.objects: dict[str, Any] = {}
        self.poses: dict[str, Any] = {}
        self.colours: dict[str, Any] = {}
        self.refuse = False
        self.services = [
            rospy.Service("/apply_planning_scene", ApplyPlanningScene, self.apply),
            rospy.Service("/get_planning_scene", GetPlanningScene, self.read),
        ]

    def apply(self, request: Any) -> ApplyPlanningSceneResponse:
        if self.refuse:
            return ApplyPlanningSceneResponse(False)
        with self.lock:
            self.colours |= {item.id: item.color for item in request.scene.object_colors}
            for item in request.scene.world.collision_objects:
                if item.operation == CollisionObject.REMOVE:
                    self.objects.pop(item.id, None)
                    continue
                if item.operation == CollisionObject.ADD:
                    self.objects[item.id] = item
                self.poses[item.id] = item.pose.position
        return ApplyPlanningSceneResponse(True)

    def read(self, _request: Any) -> GetPlanningSceneResponse:
        answer = GetPlanningSceneResponse()
        with self.lock:
            answer.scene.world.collision_objects = [CollisionObject(id=name) for name in self.objects]
        return answer

    def clear(self) -> None:
        """What a REMOVE with an empty id does."""
        with self.lock:
            self.objects.clear()

    def shutdown(self) -> None:
        for service in self.services:
            service.shutdown("test")
