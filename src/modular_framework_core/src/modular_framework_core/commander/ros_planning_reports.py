# SPDX-License-Identifier: BSD-3-Clause
"""Receives the reasons of failed plans, which move_group publishes in addition to its error codes."""

from __future__ import annotations

import json
from collections import OrderedDict

import rospy
from std_msgs.msg import String

from modular_framework_ros.calls import wait_until

REPORT_TOPIC = "move_group/planning_report"
REPORT_WAIT_S = 2.0  # wait for a report if a publisher is connected; long enough for a busy machine
UNKNOWN_REPORTER_WAIT_S = 0.3  # wait for a report if no publisher is connected
MAX_REPORTS = 64


class PlanningReports:
    """Keeps the latest reports of move_group.

    Subscribers: ``move_group/planning_report`` (std_msgs/String, JSON).
    """

    def __init__(self) -> None:
        self._reports: OrderedDict[str, dict[str, object]] = OrderedDict()
        self._subscriber: rospy.Subscriber | None = None

    def connect(self) -> None:
        """Subscribes to the reports."""
        self._subscriber = rospy.Subscriber(REPORT_TOPIC, String, self._on_report, queue_size=10)

    def reason_of(self, request: str) -> str:
        """Returns the reason of a failed plan, or "" if move_group does not report it in time.

        Args:
            request: Name of the planning request.
        """
        is_published = self._subscriber is not None and self._subscriber.get_num_connections() > 0
        wait_until(lambda: request in self._reports, REPORT_WAIT_S if is_published else UNKNOWN_REPORTER_WAIT_S)
        return str(self._reports.get(request, {}).get("reason", ""))

    def _on_report(self, message: String) -> None:
        try:
            report = json.loads(message.data)
            name = str(report.get("request_name", ""))
        except (ValueError, AttributeError) as error:
            rospy.logwarn_throttle(10.0, f"Topic '{rospy.resolve_name(REPORT_TOPIC)}': unreadable report ({error!r})")
            return
        if not name:
            return
        self._reports[name] = report
        while len(self._reports) > MAX_REPORTS:
            self._reports.popitem(last=False)
