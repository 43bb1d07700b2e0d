# SPDX-License-Identifier: BSD-3-Clause
"""The topic `command` of controllers that do at once what it says."""
from __future__ import annotations

import rospy
from std_msgs.msg import Float64, Float64MultiArray

from modular_framework_control.controller import ControllerError
from modular_framework_control.joint_command_controllers import JointCommandController
from modular_framework_control.loop_time import LoopTime
from modular_framework_control.node_handle import join_names
from modular_framework_control.ros_outbox import Outbox


class JointCommandEdge:
    """Subscribes `<name>/command`: std_msgs/Float64 for one joint, std_msgs/Float64MultiArray for several."""

    def __init__(self, controller: JointCommandController, namespace: str, name: str, outbox: Outbox,
                 loop_time: LoopTime) -> None:
        del outbox, loop_time
        self._controller = controller
        self._topic = join_names(namespace, f"{name}/command")
        kind = Float64 if controller.single else Float64MultiArray
        self._subscriber = rospy.Subscriber(self._topic, kind, self._on_command, queue_size=1)

    def _on_command(self, message: Float64 | Float64MultiArray) -> None:
        values = [message.data] if self._controller.single else list(message.data)
        try:
            self._controller.submit(values)
        except ControllerError as error:
            rospy.logwarn_throttle(1.0, f"{self._topic} ignored: {error}")

    def close(self) -> None:
        """Close the topic."""
        self._subscriber.unregister()
