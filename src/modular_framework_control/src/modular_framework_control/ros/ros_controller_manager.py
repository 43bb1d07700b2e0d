# SPDX-License-Identifier: BSD-3-Clause
"""The controller manager on ROS: its services, and its controllers' topics and actions.

Whoever owns the control loop makes one, calls `connect` once, then `update` in every cycle between the hardware's
`read` and `write`, and `close` at the end.
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
    """Controllers of one robot, reachable over ROS.

    Services, below `<namespace>/controller_manager`: `load_controller`, `unload_controller`, `switch_controller`,
    `list_controllers`, `list_controller_types`, `reload_controller_libraries`. Publishes, there and once a second of
    real time while the loop runs, `statistics` (controller_manager_msgs/ControllersStatistics).

    Args:
        robot_hw: initialised hardware.
        namespace: namespace of the robot; controllers and their parameters are found below it.
        types: known controller types; the built-in ones when not given.
        loop_time: says how stamps of messages differ from the time given to `update`; not at all when not given.
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
        self.manager = ControllerManager(robot_hw, RosNodeHandle(namespace), types, self._attach)
        self._services: list[rospy.Service] = []
        self._statistics: rospy.Publisher | None = None
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
        self._statistics = rospy.Publisher(
            join_names(self._namespace, "controller_manager/statistics"), ControllersStatistics, queue_size=1
        )
        for name, kind, answer in (
            ("load_controller", LoadController, self._on_load),
            ("unload_controller", UnloadController, self._on_unload),
            ("switch_controller", SwitchController, self._on_switch),
            ("list_controllers", ListControllers, self._on_list),
            ("list_controller_types", ListControllerTypes, self._on_list_types),
            ("reload_controller_libraries", ReloadControllerLibraries, self._on_reload),
        ):
            full_name = join_names(self._namespace, f"controller_manager/{name}")
            self._services.append(rospy.Service(full_name, kind, answer))

    def update(
        self,
        time_s: float,
        period_s: float,
        reset_controllers: bool = False,
        reset_reason: str = RESET_REASON,
    ) -> None:
        """One control cycle; see ControllerManager.update."""
        self.manager.update(time_s, period_s, reset_controllers, reset_reason)
        now_s = time.monotonic()
        if self._statistics is not None and now_s >= self._statistics_due_s:
            self._statistics_due_s = now_s + STATISTICS_PERIOD_S
            self._outbox.publish(self._statistics, self._statistics_message)

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
        """Whether a controller carries out a goal."""
        return self.manager.moving

    def flush(self, timeout_s: float = 2.0) -> None:
        """Waits until everything is published that controllers have handed over so far, at most `timeout_s` [s]."""
        self._outbox.flush(timeout_s)

    def close(self) -> None:
        """Ends all goals, closes all topics and services; the control loop must have ended. May be called twice."""
        while self._services:
            self._services.pop().shutdown("controller manager closed")
        self.manager.stop_all()
        self._outbox.close()
        self.manager.close()
        self._log.end()
        if self._statistics is not None:
            self._statistics.unregister()
            self._statistics = None

    def _on_load(self, request: Any) -> LoadControllerResponse:
        return LoadControllerResponse(_done(lambda: self.manager.load_controller(request.name)))

    def _on_unload(self, request: Any) -> UnloadControllerResponse:
        return UnloadControllerResponse(_done(lambda: self.manager.unload_controller(request.name)))

    def _on_switch(self, request: Any) -> SwitchControllerResponse:
        return SwitchControllerResponse(
            _done(
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
            _done(lambda: self.manager.reload_controller_libraries(request.force_kill))
        )


def _done(action: Callable[[], None]) -> bool:
    """Calls an operation of the manager; the services only answer `ok`, so the reason of a failure is logged."""
    try:
        action()
    except ControllerError as error:
        rospy.logerr("controller_manager: %s", error)
        return False
    return True
