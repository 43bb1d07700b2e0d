# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that report force-torque sensors, IMUs and the speed scaling of a robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.hardware_interface.interfaces import (
    ForceTorqueSensorInterface,
    ImuSensorInterface,
    SpeedScalingInterface,
)
from modular_framework_control.realtime.schedule import Schedule
from modular_framework_ros.node_handle import NodeHandle, read_number


class SensorController(Controller):
    """Base class of controllers that report all sensors of one type at a fixed rate.

    Parameters, below the controller's name: `publish_rate` [1/s] 50; 0 disables publishing.

    Attributes:
        sensor_names: Sensors, in the order of the hardware.
        on_reading: Function called in the control loop with the time [s] and a sensor's handle; must copy the values
            and not block.
    """

    def __init__(self) -> None:
        self.sensor_names: list[str] = []
        self.on_reading: Callable[[float, Any], None] | None = None
        self._handles: list[Any] = []

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self._schedule = Schedule(read_number(controller_nh, "publish_rate", 50.0))
        self.sensor_names = list(hw.names)
        self._handles = [hw.get_handle(name) for name in self.sensor_names]
        return True

    def starting(self, time_s: float) -> None:
        self._schedule.start(time_s)

    def update(self, time_s: float, period_s: float) -> None:
        if self.on_reading is not None and self._schedule.take_if_due(time_s):
            for handle in self._handles:
                self.on_reading(time_s, handle)


class ForceTorqueSensorController(SensorController):
    """force_torque_sensor_controller/ForceTorqueSensorController."""

    interface_class = ForceTorqueSensorInterface


class ImuSensorController(SensorController):
    """imu_sensor_controller/ImuSensorController."""

    interface_class = ImuSensorInterface


class SpeedScalingStateController(SensorController):
    """scaled_controllers/SpeedScalingStateController."""

    interface_class = SpeedScalingInterface
