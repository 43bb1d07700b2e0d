# SPDX-License-Identifier: BSD-3-Clause
"""Services that list pipelines and planners, and get and set the planners' parameters."""

from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.msg import PlannerInterfaceDescription, PlannerParams
from moveit_msgs.srv import (
    GetPlannerParams,
    GetPlannerParamsResponse,
    QueryPlannerInterfaces,
    QueryPlannerInterfacesResponse,
    SetPlannerParams,
    SetPlannerParamsResponse,
)

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import MoveGroupCapability
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline


class QueryPlannersService(MoveGroupCapability):
    """Offers query_planner_interface, get_planner_params and set_planner_params."""

    def connect(self) -> None:
        """Advertises the services."""
        rospy.Service(names.QUERY_PLANNERS_SERVICE, QueryPlannerInterfaces, self._query)
        rospy.Service(names.GET_PLANNER_PARAMS_SERVICE, GetPlannerParams, self._get)
        rospy.Service(names.SET_PLANNER_PARAMS_SERVICE, SetPlannerParams, self._set)

    def _query(self, _: Any) -> QueryPlannerInterfacesResponse:
        return QueryPlannerInterfacesResponse(
            [
                PlannerInterfaceDescription(
                    name=pipeline.description, pipeline_id=name, planner_ids=self._ids(pipeline)
                )
                for name, pipeline in self._context.pipelines.items()
            ]
        )

    def _ids(self, pipeline: PlanningPipeline) -> list[str]:
        """Returns the planner names for all groups, then group[name] for the planners of a single group."""
        return [
            *pipeline.planner_ids,
            *(f"{group}[{name}]" for group in self._context.model.groups for name in pipeline.group_planners(group)),
        ]

    def _get(self, request: Any) -> GetPlannerParamsResponse:
        """Returns the parameters of a planner; as in MoveIt, none for an unknown planner or group."""
        try:
            pipeline = self._context.pipeline(request.pipeline_id)
        except PlanningError as error:
            raise rospy.ServiceException(error.reason) from error
        values = pipeline.configurations.get(request.planner_config, request.group)
        return GetPlannerParamsResponse(
            PlannerParams(
                keys=list(values), values=[_text(v) for v in values.values()], descriptions=[""] * len(values)
            )
        )

    def _set(self, request: Any) -> SetPlannerParamsResponse:
        try:
            pipeline = self._requested_pipeline(request)
            if len(request.params.keys) != len(request.params.values):
                raise PlanningError(
                    ErrorCode.FAILURE,
                    f"set_planner_params: {len(request.params.keys)} keys and "
                    f"{len(request.params.values)} values; give one value per key",
                )
        except PlanningError as error:
            raise rospy.ServiceException(error.reason) from error
        values = dict(zip(request.params.keys, request.params.values, strict=True))
        pipeline.configurations.set(request.planner_config, request.group, values, request.replace)
        for fault in pipeline.parameter_faults(request.planner_config, request.group):
            rospy.logwarn("set_planner_params, %s: %s", request.planner_config, fault)
        return SetPlannerParamsResponse()

    def _requested_pipeline(self, request: Any) -> PlanningPipeline:
        """Returns the pipeline; raises PlanningError for a pipeline or group that does not exist."""
        if request.group:
            self._context.model.group(request.group)
        if not request.planner_config:
            raise PlanningError(ErrorCode.FAILURE, "set_planner_params: planner_config is empty; name a planner")
        return self._context.pipeline(request.pipeline_id)


def _text(value: object) -> str:
    """Returns a value as text for the message, with booleans as 0 and 1."""
    return str(int(value)) if isinstance(value, bool) else str(value)
