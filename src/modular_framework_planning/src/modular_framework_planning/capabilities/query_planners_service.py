# SPDX-License-Identifier: BSD-3-Clause
"""Service query_planner_interface: lists pipeline and planners."""
from __future__ import annotations

from typing import Any

import rospy
from moveit_msgs.msg import PlannerInterfaceDescription
from moveit_msgs.srv import QueryPlannerInterfaces, QueryPlannerInterfacesResponse

from modular_framework_planning import capability_names as names
from modular_framework_planning.ros_context import MoveGroupContext


class QueryPlannersService:
    """Offers query_planner_interface (moveit_msgs/QueryPlannerInterfaces)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises the service."""
        rospy.Service(names.QUERY_PLANNERS_SERVICE, QueryPlannerInterfaces, self._serve)

    def _serve(self, _: Any) -> QueryPlannerInterfacesResponse:
        return QueryPlannerInterfacesResponse([
            PlannerInterfaceDescription(name="OMPL", pipeline_id=name, planner_ids=sorted(pipeline.planner_ids))
            for name, pipeline in self._context.pipelines.items()])
