# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the fault of a gripper as diagnostics, for a node without a control loop."""

from __future__ import annotations

import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper
from modular_framework_ros.publishing import publish

REPORT_PERIOD_S, WATCH_PERIOD_S = 1.0, 0.1


class GripperReport:
    """Publishes `/diagnostics` (diagnostic_msgs/DiagnosticArray) once a second of real time, and at each change.

    The level is ERROR if the gripper has a fault; the only value is `fault`.

    Args:
        gripper: Gripper device.
    """

    def __init__(self, gripper: EzGripper) -> None:
        self._gripper = gripper
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="gripper_report", daemon=True)

    def connect(self) -> None:
        """Opens the topic and starts publishing."""
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=1)
        self._thread.start()

    def close(self) -> None:
        """Stops publishing; may be called twice."""
        self._ended.set()

    def _run(self) -> None:
        reported, due_s = "", time.monotonic() + REPORT_PERIOD_S
        while not self._ended.wait(WATCH_PERIOD_S) and not rospy.is_shutdown():
            fault, now_s = self._gripper.state().fault, time.monotonic()
            if fault != reported or now_s >= due_s:
                self._publish(fault)
                reported, due_s = fault, now_s + REPORT_PERIOD_S

    def _publish(self, fault: str) -> None:
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if fault else DiagnosticStatus.OK,
            name=f"{rospy.get_name().lstrip('/')}: gripper",
            hardware_id=self._gripper.settings.name,
            message=f"hardware fault: {fault}" if fault else "no fault",
            values=[KeyValue("fault", fault)],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = rospy.Time.now()
        publish(self._publisher, message)
