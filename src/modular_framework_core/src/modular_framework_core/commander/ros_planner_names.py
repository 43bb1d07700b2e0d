# SPDX-License-Identifier: BSD-3-Clause
"""Asks move_group for its planners."""

from __future__ import annotations

import re

import rospy
from moveit_msgs.srv import QueryPlannerInterfaces, QueryPlannerInterfacesRequest

from modular_framework_ros.calls import call_service, wait_for_service

PLANNERS_SERVICE = "query_planner_interface"
SERVICE_TIMEOUT_S = 10.0


def planners_by_pipeline(timeout_s: float = SERVICE_TIMEOUT_S, group: str = "") -> dict[str, set[str]]:
    """Returns the available planners, keyed by pipeline.

    Args:
        timeout_s: Maximum wait for the service [s of real time].
        group: Planning group, whose own configurations are included; "" for the configurations of all groups.

    Raises:
        CallError: The service is absent or does not answer.
    """
    proxy = rospy.ServiceProxy(PLANNERS_SERVICE, QueryPlannerInterfaces)
    wait_for_service(proxy, timeout_s)
    response = call_service(proxy, QueryPlannerInterfacesRequest(), SERVICE_TIMEOUT_S)
    # GROUP[PLANNER] or PLANNER
    pattern = re.compile(rf"(?:(?:{re.escape(group) if group else '.*?'})\[(.*)\]|([^\]]*))")
    return {
        pipeline.pipeline_id: {match[1] or match[2] for match in map(pattern.fullmatch, pipeline.planner_ids) if match}
        for pipeline in response.planner_interfaces
    }
