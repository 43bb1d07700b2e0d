# SPDX-License-Identifier: BSD-3-Clause
"""The topics of controllers that report sensors: one a sensor, under its name in the namespace of the robot."""
from __future__ import annotations

from typing import Any

import rospy
from geometry_msgs.msg import Quaternion, Vector3, WrenchStamped
from sensor_msgs.msg import Imu

from modular_framework_control.handles import ForceTorqueSensorHandle, ImuSensorHandle
from modular_framework_control.loop_time import LoopTime
from modular_framework_control.node_handle import join_names
from modular_framework_control.ros_outbox import Outbox
from modular_framework_control.sensor_controllers import ForceTorqueSensorController, SensorController


class SensorEdge:
    """Publishes geometry_msgs/WrenchStamped for force-torque sensors, sensor_msgs/Imu for inertial units."""

    def __init__(self, controller: SensorController, namespace: str, name: str, outbox: Outbox,
                 loop_time: LoopTime) -> None:
        del name
        wrenches = isinstance(controller, ForceTorqueSensorController)
        self._publishers = {
            sensor: rospy.Publisher(join_names(namespace, sensor), WrenchStamped if wrenches else Imu, queue_size=4)
            for sensor in controller.sensor_names}
        to_msg = wrench_to_msg if wrenches else imu_to_msg
        controller.on_reading = lambda time_s, handle: outbox.put_droppable(
            self._publishers[handle.name].publish, to_msg(time_s + loop_time.ahead_s, handle))

    def close(self) -> None:
        """Close the topics."""
        for publisher in self._publishers.values():
            publisher.unregister()


def wrench_to_msg(time_s: float, handle: ForceTorqueSensorHandle) -> WrenchStamped:
    """What a force-torque sensor measured at `time_s` of the ROS clock [s]."""
    message = _stamped(WrenchStamped(), time_s, handle.frame_id)
    message.wrench.force = Vector3(*handle.force)
    message.wrench.torque = Vector3(*handle.torque)
    return message


def imu_to_msg(time_s: float, handle: ImuSensorHandle) -> Imu:
    """What an inertial unit measured at `time_s` of the ROS clock [s]."""
    message = _stamped(Imu(), time_s, handle.frame_id)
    message.orientation = Quaternion(*handle.orientation)
    message.angular_velocity = Vector3(*handle.angular_velocity)
    message.linear_acceleration = Vector3(*handle.linear_acceleration)
    message.orientation_covariance = handle.orientation_covariance
    message.angular_velocity_covariance = handle.angular_velocity_covariance
    message.linear_acceleration_covariance = handle.linear_acceleration_covariance
    return message


def _stamped(message: Any, time_s: float, frame_id: str) -> Any:
    message.header.stamp = rospy.Time.from_sec(time_s)
    message.header.frame_id = frame_id
    return message
