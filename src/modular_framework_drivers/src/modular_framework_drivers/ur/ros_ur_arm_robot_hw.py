# SPDX-License-Identifier: BSD-3-Clause
"""Connects a UR arm to ROS: publishes its readiness, serves `resume` and the dashboard."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, ClassVar

import rospy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_drivers.ur.dashboard import DashboardError, request_dashboard
from modular_framework_drivers.ur.ur_arm_robot_hw import UrArmHardware
from modular_framework_ros.node_handle import NodeHandle, join_names
from modular_framework_ros.parameter_declarations import parameters_below
from modular_framework_ros.publishing import publish

# Dashboard services under the names of ur_robot_driver: request and start of a successful response
DASHBOARD_SERVICES = {
    "power_on": ("power on", "Powering on"),
    "power_off": ("power off", "Powering off"),
    "brake_release": ("brake release", "Brake releasing"),
    "unlock_protective_stop": ("unlock protective stop", "Protective stop releasing"),
    "restart_safety": ("restart safety", "Restarting safety"),
    "close_safety_popup": ("close safety popup", "closing safety popup"),
    "close_popup": ("close popup", "closing popup"),
    "play": ("play", "Starting program"),
    "pause": ("pause", "Pausing program"),
    "stop": ("stop", "Stopped"),
}
_WATCH_PERIOD_S = 0.05


class UrArmRobotHW(UrArmHardware):
    """A UR arm with the parameters of `UrArmHardware`.

    Publishes on `topic_to_wait_for` (std_msgs/Bool, latched) whether the arm follows commands. Serves, in its own
    namespace, `resume` and `dashboard/<name>` for each name in DASHBOARD_SERVICES (std_srvs/Trigger).
    """

    announces_ready: ClassVar[bool] = True

    def __init__(self) -> None:
        super().__init__()
        self._publisher: rospy.Publisher | None = None
        self._services: list[rospy.Service] = []
        self._closing = threading.Event()

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        if not super().init(root_nh, robot_hw_nh):
            return False
        topic = parameters_below("modular_framework_control", "hardware", robot_hw_nh, root_nh).value(
            "~topic_to_wait_for"
        )
        if topic:
            self._publisher = rospy.Publisher(topic, Bool, queue_size=1, latch=True)
        self._advertise_service(join_names(robot_hw_nh.namespace, "resume"), self._on_resume)
        for name in DASHBOARD_SERVICES:
            self._advertise_service(
                join_names(robot_hw_nh.namespace, f"dashboard/{name}"), self._dashboard_callback(name)
            )
        threading.Thread(target=self._publish_readiness, name="ur_ready", daemon=True).start()
        return True

    def close(self) -> None:
        self._closing.set()
        while self._services:
            self._services.pop().shutdown("the arm is closed")
        super().close()

    def _advertise_service(self, name: str, callback: Callable[[Any], TriggerResponse]) -> None:
        self._services.append(rospy.Service(name, Trigger, callback))

    def _publish_readiness(self) -> None:
        published: bool | None = None
        while not self._closing.wait(_WATCH_PERIOD_S):
            ready = self.ready
            if ready != published and self._publisher is not None:
                publish(self._publisher, Bool(ready))
                published = ready

    def _on_resume(self, request: Any) -> TriggerResponse:
        del request
        fault = self.resume()
        return TriggerResponse(success=not fault, message=fault or "the arm follows commands")

    def _dashboard_callback(self, name: str) -> Callable[[Any], TriggerResponse]:
        line, success_prefix = DASHBOARD_SERVICES[name]

        def on_request(request: Any) -> TriggerResponse:
            del request
            try:
                response = request_dashboard(self.address, line)
            except DashboardError as error:
                return TriggerResponse(success=False, message=str(error))
            return TriggerResponse(success=response.startswith(success_prefix), message=response)

        return on_request
