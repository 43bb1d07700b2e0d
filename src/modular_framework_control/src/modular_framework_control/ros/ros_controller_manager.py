# SPDX-License-Identifier: BSD-3-Clause
"""Provides the ROS services of the controller manager, and the topics and actions of its controllers.

The owner of the control loop creates a RosControllerManager and calls `connect` once, then `update` in every cycle
between `read` and `write` of the hardware, and `close` at the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
from controller_manager_msgs.msg import ControllersStatistics
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllersResponse,
    ListControllerTypes,
    ListControllerTypesResponse,
    LoadController,
    LoadControllerResponse,
    ReloadControllerLibraries,
    ReloadControllerLibrariesResponse,
    SwitchController,
    SwitchControllerResponse,
    UnloadController,
    UnloadControllerResponse,
)

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_manager.controller_manager import RESET_REASON, ControllerManager
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.ros import conversions
from modular_framework_control.ros.controller_interfaces import attach_ros
from modular_framework_control.ros.loop_log import LoopLog
from modular_framework_control.ros.outbox import Outbox
from modular_framework_ros.node_handle import join_names
from modular_framework_ros.ros_node_handle import RosNodeHandle

STATISTICS_PERIOD_S = 1.0


class RosControllerManager:
    """Runs the controllers of one robot and provides them over ROS.

    Services in `<namespace>/controller_manager`: `load_controller`, `unload_controller`, `switch_controller`,
    `list_controllers`, `list_controller_types`, `reload_controller_libraries`. Topic in the same namespace:
    `statistics` (controller_manager_msgs/ControllersStatistics), once a second of real time while the loop runs.

    Args:
        robot_hw: Initialised hardware.
        namespace: Namespace of the robot, which contains the controllers and their parameters.
        types: Known controller types; None for the built-in types.
        loop_time: Offset between the stamps of messages and the time given to `update`; None for no offset.
    """

    def __init__(
        self,
        robot_hw: RobotHW,
        namespace: str = "/",
        types: ControllerTypes | None = None,
        loop_time: LoopTime | None = None,
    ) -> None:
        self._namespace = namespace
        self._outbox, self._log = Outbox(), LoopLog()
        self._loop_time = loop_time if loop_time is not None else LoopTime()
        self.manager = ControllerManager(robot_hw, RosNodeHandle(namespace), types, attach=self._attach)
        self._services: list[rospy.Service] = []
        self._statistics_publisher: rospy.Publisher | None = None
        self._statistics_due_s = 0.0

    def _attach(self, name: str, controller: Controller) -> Callable[[], None]:
        close = attach_ros(controller, self._namespace, name, self._outbox, self._loop_time)

        def detach() -> None:
            self.flush()
            close()

        return detach

    def connect(self) -> None:
        """Advertises the services."""
        self._outbox.start()
        self._log.begin()
        self._statistics_publisher = rospy.Publisher(
            join_names(self._namespace, "controller_manager/statistics"), ControllersStatistics, queue_size=1
        )
        for name, service_class, handler in (
            ("load_controller", LoadController, self._on_load),
            ("unload_controller", UnloadController, self._on_unload),
            ("switch_controller", SwitchController, self._on_switch),
            ("list_controllers", ListControllers, self._on_list),
            ("list_controller_types", ListControllerTypes, self._on_list_types),
            ("reload_controller_libraries", ReloadControllerLibraries, self._on_reload),
        ):
            full_name = join_names(self._namespace, f"controller_manager/{name}")
            self._services.append(rospy.Service(full_name, service_class, handler))

    def update(
        self,
        time_s: float,
        period_s: float,
        reset_controllers: bool = False,
        reset_reason: str = RESET_REASON,
    ) -> None:
        """Runs one control cycle, with the arguments of ControllerManager.update.

        Args:
            time_s: Time of the cycle on the clock of the loop [s].
            period_s: Time since the previous cycle [s].
            reset_controllers: Whether to restart the running controllers.
            reset_reason: Reason of the restart, sent to the clients of ended goals.
        """
        self.manager.update(time_s, period_s, reset_controllers, reset_reason)
        now_s = time.monotonic()
        if self._statistics_publisher is not None and now_s >= self._statistics_due_s:
            self._statistics_due_s = now_s + STATISTICS_PERIOD_S
            self._outbox.publish(self._statistics_publisher, self._statistics_message)

    def _statistics_message(self) -> ControllersStatistics:
        message = ControllersStatistics()
        message.header.stamp = rospy.Time.now()
        message.controller = [
            conversions.controller_statistics_to_msg(report, self._loop_time.ahead_s)
            for report in self.manager.list_controllers()
        ]
        return message

    @property
    def moving(self) -> bool:
        """Whether a controller executes a goal."""
        return self.manager.moving

    def flush(self, timeout_s: float = 2.0) -> None:
        """Waits at most `timeout_s` [s] until all messages that the controllers have passed on are published."""
        self._outbox.flush(timeout_s)

    def close(self) -> None:
        """Ends all goals and closes all topics and services, after the end of the loop; may be called twice."""
        while self._services:
            self._services.pop().shutdown("controller manager closed")
        self.manager.stop_all()
        self._outbox.close()
        self.manager.close()
        self._log.end()
        if self._statistics_publisher is not None:
            self._statistics_publisher.unregister()
            self._statistics_publisher = None

    def _on_load(self, request: Any) -> LoadControllerResponse:
        return LoadControllerResponse(_has_succeeded(lambda: self.manager.load_controller(request.name)))

    def _on_unload(self, request: Any) -> UnloadControllerResponse:
        return UnloadControllerResponse(_has_succeeded(lambda: self.manager.unload_controller(request.name)))

    def _on_switch(self, request: Any) -> SwitchControllerResponse:
        return SwitchControllerResponse(
            _has_succeeded(
                lambda: self.manager.switch_controller(
                    request.start_controllers,
                    request.stop_controllers,
                    request.strictness,
                    request.start_asap,
                    max(0.0, request.timeout),
                )
            )
        )

    def _on_list(self, request: Any) -> ListControllersResponse:
        del request
        return ListControllersResponse(
            [conversions.controller_report_to_msg(report) for report in self.manager.list_controllers()]
        )

    def _on_list_types(self, request: Any) -> ListControllerTypesResponse:
        del request
        pairs = self.manager.list_controller_types()
        return ListControllerTypesResponse([name for name, _ in pairs], [base for _, base in pairs])

    def _on_reload(self, request: Any) -> ReloadControllerLibrariesResponse:
        return ReloadControllerLibrariesResponse(
            _has_succeeded(lambda: self.manager.reload_controller_libraries(request.force_kill))
        )


def _has_succeeded(action: Callable[[], None]) -> bool:
    """Calls an operation of the manager; logs the cause of a failure, as the responses only contain `ok`."""
    try:
        action()
    except ControllerError as error:
        rospy.logerr("controller_manager: %s", error)
        return False
    return True
