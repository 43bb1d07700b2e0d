# SPDX-License-Identifier: BSD-3-Clause
"""Services get_planning_scene, apply_planning_scene and clear_octomap."""

from __future__ import annotations

from typing import Any

from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
)
from std_srvs.srv import Empty, EmptyResponse

from modular_framework_planning.messages.scene_messages import apply_scene, scene_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ServiceCapability


class GetPlanningSceneService(ServiceCapability):
    """Offers get_planning_scene (GetPlanningScene), which returns the requested parts of the current scene."""

    name, kind = names.GET_SCENE_SERVICE, GetPlanningScene

    def _serve(self, request: Any) -> GetPlanningSceneResponse:
        return GetPlanningSceneResponse(scene_message(self._context.monitor.snapshot(), request.components.components))


class ApplyPlanningSceneService(ServiceCapability):
    """Offers apply_planning_scene (ApplyPlanningScene); the change is applied before the response."""

    name, kind = names.APPLY_SCENE_SERVICE, ApplyPlanningScene

    def _serve(self, request: Any) -> ApplyPlanningSceneResponse:
        try:
            self._context.monitor.apply(lambda scene: apply_scene(scene, request.scene))
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            self._context.reporter.failure("scene", error)
            return ApplyPlanningSceneResponse(success=False)
        return ApplyPlanningSceneResponse(success=True)


class ClearOctomapService(ServiceCapability):
    """Offers clear_octomap (std_srvs/Empty), which empties the octomap until the next sensor message."""

    name, kind = names.CLEAR_OCTOMAP_SERVICE, Empty

    def _serve(self, _: Any) -> EmptyResponse:
        self._context.monitor.apply(lambda scene: scene.with_octomap(None))
        return EmptyResponse()
