# SPDX-License-Identifier: BSD-3-Clause
"""Publishes each sensor of a sensor controller on a topic named after the sensor in the namespace of the robot."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from geometry_msgs.msg import Quaternion, Vector3, WrenchStamped
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64

from modular_framework_control.controllers.sensor_controllers import SensorController
from modular_framework_control.hardware_interface.handles import (
    ForceTorqueSensorHandle,
    ImuSensorHandle,
    SpeedScalingHandle,
)
from modular_framework_control.hardware_interface.interfaces import (
    ForceTorqueSensorInterface,
    HardwareInterface,
    ImuSensorInterface,
    SpeedScalingInterface,
)
from modular_framework_control.ros.controller_connection import ControllerConnection
from modular_framework_ros.node_handle import join_names


class SensorRosInterface:
    """Publishes the measurements of sensors.

    The type is geometry_msgs/WrenchStamped for force-torque sensors, sensor_msgs/Imu for inertial measurement units,
    and std_msgs/Float64 for speed scaling.
    """

    def __init__(self, controller: SensorController, connection: ControllerConnection) -> None:
        message_class, to_msg = _MESSAGES[controller.interface_class]
        publish = {
            sensor: connection.advertise(join_names(connection.namespace, sensor), message_class, queue_size=4)
            for sensor in controller.sensor_names
        }

        def report(time_s: float, handle: Any) -> None:
            reading = copy.copy(handle)  # the loop changes the handle in the next cycle
            publish[handle.name](lambda: to_msg(time_s + connection.ahead_s, reading))

        controller.on_reading = report


def wrench_to_msg(time_s: float, handle: ForceTorqueSensorHandle) -> WrenchStamped:
    """Converts the measurement of a force-torque sensor at ROS time `time_s` [s]."""
    message = _stamped_message(WrenchStamped(), time_s, handle.frame_id)
    message.wrench.force = Vector3(*handle.force)
    message.wrench.torque = Vector3(*handle.torque)
    return message


def imu_to_msg(time_s: float, handle: ImuSensorHandle) -> Imu:
    """Converts the measurement of an inertial measurement unit at ROS time `time_s` [s]."""
    message = _stamped_message(Imu(), time_s, handle.frame_id)
    message.orientation = Quaternion(*handle.orientation)
    message.angular_velocity = Vector3(*handle.angular_velocity)
    message.linear_acceleration = Vector3(*handle.linear_acceleration)
    message.orientation_covariance = handle.orientation_covariance
    message.angular_velocity_covariance = handle.angular_velocity_covariance
    message.linear_acceleration_covariance = handle.linear_acceleration_covariance
    return message


def speed_scaling_to_msg(time_s: float, handle: SpeedScalingHandle) -> Float64:
    """Converts a speed scaling factor in [0, 1]; the message has no stamp."""
    del time_s
    return Float64(handle.factor)


def _stamped_message(message: Any, time_s: float, frame_id: str) -> Any:
    message.header.stamp = rospy.Time.from_sec(time_s)
    message.header.frame_id = frame_id
    return message


_MESSAGES: Mapping[type[HardwareInterface[Any]], tuple[type[Any], Callable[[float, Any], Any]]] = {
    ForceTorqueSensorInterface: (WrenchStamped, wrench_to_msg),
    ImuSensorInterface: (Imu, imu_to_msg),
    SpeedScalingInterface: (Float64, speed_scaling_to_msg),
}
