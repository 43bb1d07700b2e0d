# SPDX-License-Identifier: BSD-3-Clause
"""Reports of all planning, kinematics and execution results, in the log and as JSON on ~planning_report."""

from __future__ import annotations

import itertools
import json
from typing import Any

import rospy
from moveit_msgs.msg import MotionPlanRequest
from std_msgs.msg import String

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.move_group import capability_names as names
from modular_framework_ros.publishing import publish


class Reporter:
    """Publishes ~planning_report (std_msgs/String, JSON) and optionally ~motion_plan_request (latched)."""

    def __init__(self, publish_requests: bool = False) -> None:
        """Advertises the topics.

        Args:
            publish_requests: Whether planning requests are published, as by MoveIt with the argument --debug.
        """
        self._ids = itertools.count(1)
        self._publisher = rospy.Publisher(names.REPORT_TOPIC, String, queue_size=100)
        self._requests = (
            rospy.Publisher(names.REQUEST_TOPIC, MotionPlanRequest, queue_size=10, latch=True)
            if publish_requests
            else None
        )

    def request(self, message: MotionPlanRequest) -> None:
        """Publishes a planning request."""
        if self._requests is not None:
            publish(self._requests, message)

    def report(self, kind: str, code: int, reason: str, **details: Any) -> None:
        """Publishes a result and logs a failure.

        Args:
            kind: Kind of result: plan, ik, fk, validity, scene or execute.
            code: Value of moveit_msgs/MoveItErrorCodes.
            reason: Reason of a failure; empty on success.
            **details: Additional keys with JSON values.
        """
        entry = {
            "id": next(self._ids),
            "time": rospy.get_time(),
            "kind": kind,
            "error_code": int(code),
            "reason": reason,
            **details,
        }
        if code != ErrorCode.SUCCESS:
            name = ErrorCode(code).name if code in set(ErrorCode) else str(code)
            summary = f"; {details['summary']}" if details.get("summary") else ""
            rospy.logwarn("%s failed (%s): %s%s", kind, name, reason, summary)
        publish(self._publisher, String(json.dumps(entry)))

    def failure(self, kind: str, error: Exception, **details: Any) -> int:
        """Reports an exception and returns its error code."""
        if isinstance(error, PlanningError):
            if error.statistics is not None:
                details = {**details, **error.statistics.as_json()}
            self.report(kind, error.code, error.reason, **details)
            return int(error.code)
        rospy.logerr("%s: unexpected %s", kind, type(error).__name__, exc_info=error)
        self.report(kind, ErrorCode.FAILURE, f"unexpected {type(error).__name__}: {error}", **details)
        return int(ErrorCode.FAILURE)
