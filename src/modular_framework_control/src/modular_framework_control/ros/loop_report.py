# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the timing of the control loop and the faults of the hardware as diagnostics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_srvs.srv import Empty, EmptyResponse

from modular_framework_control.hardware_interface.joint_limits import outside_limits
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.cycle_pacer import LoopFigures, LoopStatistics
from modular_framework_ros.publishing import publish

REPORT_PERIOD_S, WATCH_PERIOD_S = 1.0, 0.1
OVERRUN_WARNING_PERIOD_S = 10.0


class LoopReport:
    """Publishes `/diagnostics` (diagnostic_msgs/DiagnosticArray) once a second of real time, and at each new fault.

    The service `~reset_statistics` (std_srvs/Empty) resets the statistics.

    The level is ERROR if the hardware has a fault. Otherwise, the level is WARN if cycles were late since the last
    message, a joint is outside its position limits or the hardware reports a warning.
    Values: `rate` [1/s], `cycles`, `missed`, `overruns`, `late_p50_us`, `late_p99_us`, `late_max_us`, `work_mean_us`,
    `work_max_us`, `no_processor_us` (total time of waits for a processor), `no_processor_max_us` (the longest wait for
    a processor), `fault`, `outside_limits`.

    Args:
        statistics: Timing statistics written by the loop.
        period_s: Period of the loop [s].
        robot_hw: Hardware driven by the loop.
        health: Callback that returns the fault and the warning of the hardware; each is "" if absent.
    """

    def __init__(
        self, statistics: LoopStatistics, period_s: float, robot_hw: RobotHW, health: Callable[[], tuple[str, str]]
    ) -> None:
        self._statistics = statistics
        self._period_s = period_s
        self._robot_hw = robot_hw
        self._joints_outside: frozenset[str] = frozenset()
        self._health = health
        self._late = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="loop_report", daemon=True)

    def connect(self) -> None:
        """Advertises the topic and the service, and starts publishing."""
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=1)
        self._service = rospy.Service("~reset_statistics", Empty, self._on_reset)
        self._thread.start()

    def close(self) -> None:
        """Stops publishing; may be called twice."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
            self._service.shutdown("the control loop ended")
            self._publisher.unregister()

    def _on_reset(self, request: Any) -> EmptyResponse:
        del request
        self._statistics.reset()
        self._late = 0
        return EmptyResponse()

    def _run(self) -> None:
        reported, due_s = ("", ""), time.monotonic() + REPORT_PERIOD_S
        while not self._ended.wait(WATCH_PERIOD_S) and not rospy.is_shutdown():
            health, now_s = self._health(), time.monotonic()
            if health != reported or now_s >= due_s:
                self._publish(self._statistics.figures(), *health)
                reported, due_s = health, now_s + REPORT_PERIOD_S

    def _publish(self, figures: LoopFigures, fault: str, warning: str) -> None:
        late = figures.missed + figures.overruns
        late_since_last, self._late = late > self._late, late
        outside = self._report_joints_outside()
        text = (
            f"{1.0 / self._period_s:g} Hz: {figures.overruns} of {figures.cycles} cycles overran, "
            f"{figures.missed} were skipped"
        )
        if late_since_last:
            rospy.logwarn_throttle(
                OVERRUN_WARNING_PERIOD_S,
                f"control loop at {text}; the longest cycle took {figures.work_max_s * 1e3:.1f} ms, the "
                f"period is {self._period_s * 1e3:.1f} ms; the loop waited for a processor for up to "
                f"{figures.no_processor_max_s * 1e3:.1f} ms",
            )
        status = DiagnosticStatus(
            name=f"{rospy.get_name().lstrip('/')}: control loop",
            hardware_id=type(self._robot_hw).__name__,
            message="; ".join(filter(None, (fault and f"hardware fault: {fault}", warning, outside, text))),
        )
        level = DiagnosticStatus.WARN if late_since_last or outside or warning else DiagnosticStatus.OK
        status.level = DiagnosticStatus.ERROR if fault else level
        values = {
            "rate": 1.0 / self._period_s,
            "cycles": figures.cycles,
            "missed": figures.missed,
            "overruns": figures.overruns,
            "late_p50_us": figures.late_p50_s * 1e6,
            "late_p99_us": figures.late_p99_s * 1e6,
            "late_max_us": figures.late_max_s * 1e6,
            "work_mean_us": figures.work_mean_s * 1e6,
            "work_max_us": figures.work_max_s * 1e6,
            "no_processor_us": figures.no_processor_s * 1e6,
            "no_processor_max_us": figures.no_processor_max_s * 1e6,
        }
        status.values = [KeyValue(key, f"{value:.10g}") for key, value in values.items()]
        status.values += [KeyValue("fault", fault), KeyValue("outside_limits", outside)]
        message = DiagnosticArray(status=[status])
        message.header.stamp = rospy.Time.now()
        publish(self._publisher, message)

    def _report_joints_outside(self) -> str:
        """Describes the joints outside their limits; logs each joint that has just left them."""
        outside = outside_limits(self._robot_hw)
        new = [text for name, text in outside.items() if name not in self._joints_outside]
        if new:
            rospy.logwarn("%s", "; ".join(new))
        self._joints_outside = frozenset(outside)
        return "; ".join(outside.values())
