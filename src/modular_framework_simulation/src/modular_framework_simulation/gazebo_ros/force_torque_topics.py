# SPDX-License-Identifier: BSD-3-Clause
"""Publishes what force-torque sensors measure."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from geometry_msgs.msg import Vector3, WrenchStamped

from modular_framework_simulation.gazebo_ros.camera_messages import header
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.sensors.force_torque import (
    ForceTorqueSensor,
    JointLoad,
    read_force_torque_sensors,
)

_QUEUE_SIZE = 50


class ForceTorqueTopic:
    """The topic of one sensor (geometry_msgs/WrenchStamped); called by the loop's thread.

    Args:
        world: The world.
        model: The robot.
        sensor: The sensor in one of its joints.
    """

    def __init__(self, world: PhysicsWorld, model: str, sensor: ForceTorqueSensor) -> None:
        self.sensor = sensor
        self._world, self._load = world, JointLoad(world, model, sensor)
        self._publisher = rospy.Publisher(sensor.topic, WrenchStamped, queue_size=_QUEUE_SIZE)
        self._measures = False

    def publish(self) -> None:
        """Measures and publishes, if there is a subscriber."""
        if not self._publisher.get_num_connections():
            self._measures = False
            return
        self._load.start()
        if self._measures:  # the engine has measured since the last call
            wrench = self._load.measure()
            message = WrenchStamped(header=header(self.sensor.frame_id, self._world.time_ns))
            message.wrench.force, message.wrench.torque = Vector3(*wrench.force), Vector3(*wrench.torque)
            self._publisher.publish(message)
        self._measures = True


def force_torque_topics(world: PhysicsWorld, model: str, description: str) -> Sequence[ForceTorqueTopic]:
    """Makes the topics of the sensors of a robot's URDF; what cannot be used is logged.

    Args:
        world: The world.
        model: Name of the robot in it; empty for none.
        description: Its URDF.
    """
    if not model:
        return ()
    sensors, faults = read_force_torque_sensors(description)
    for fault in faults:
        rospy.logwarn(fault)
    return [ForceTorqueTopic(world, model, sensor) for sensor in sensors]
