# SPDX-License-Identifier: BSD-3-Clause
"""Services get_planning_scene, apply_planning_scene and clear_octomap."""

from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
)
from std_srvs.srv import Empty, EmptyResponse

from modular_framework_planning.messages.scene_messages import apply_scene, scene_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.context import MoveGroupContext


class GetPlanningSceneService:
    """Offers get_planning_scene (GetPlanningScene): the asked parts of the current scene."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.GET_SCENE_SERVICE, GetPlanningScene, self._serve)

    def _serve(self, request: Any) -> GetPlanningSceneResponse:
        return GetPlanningSceneResponse(scene_message(self._context.monitor.snapshot(), request.components.components))


class ApplyPlanningSceneService:
    """Offers apply_planning_scene (ApplyPlanningScene); a change is in force when it answers."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.APPLY_SCENE_SERVICE, ApplyPlanningScene, self._serve)

    def _serve(self, request: Any) -> ApplyPlanningSceneResponse:
        try:
            self._context.monitor.apply(lambda scene: apply_scene(scene, request.scene))
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            self._context.reporter.failure("scene", error)
            return ApplyPlanningSceneResponse(success=False)
        return ApplyPlanningSceneResponse(success=True)


class ClearOctomapService:
    """Offers clear_octomap (std_srvs/Empty): the octomap is empty until a sensor's next message."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.CLEAR_OCTOMAP_SERVICE, Empty, self._serve)

    def _serve(self, _: Any) -> EmptyResponse:
        self._context.monitor.apply(lambda scene: scene.with_octomap(None))
        return EmptyResponse()
