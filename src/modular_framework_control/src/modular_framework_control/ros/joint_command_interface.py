# SPDX-License-Identifier: BSD-3-Clause
"""Connects controllers that receive joint commands on a topic `command`."""

from __future__ import annotations

import rospy
from control_msgs.msg import JointControllerState
from std_msgs.msg import Float64, Float64MultiArray

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.controllers.joint_command_controllers import (
    GainsController,
    JointCommandController,
    JointControlSnapshot,
)
from modular_framework_control.ros.controller_connection import ControllerConnection


class JointCommandRosInterface:
    """Opens the topics of a controller of single joint commands.

    Subscribes to `<name>/command`: std_msgs/Float64 for one joint, std_msgs/Float64MultiArray for several joints.
    Publishes `<name>/state` (control_msgs/JointControllerState) for a PID controller of one joint.
    """

    def __init__(self, controller: JointCommandController, connection: ControllerConnection) -> None:
        self._controller = controller
        self._topic = connection.topic("command")
        connection.subscribe("command", Float64 if controller.single else Float64MultiArray, self._on_command)
        if isinstance(controller, GainsController) and controller.single:
            publish = connection.advertise("state", JointControllerState, queue_size=1)
            controller.on_state = lambda snapshot: publish(lambda: joint_control_to_msg(snapshot, connection.ahead_s))

    def _on_command(self, message: Float64 | Float64MultiArray) -> None:
        values = [message.data] if self._controller.single else list(message.data)
        try:
            self._controller.submit(values)
        except ControllerError as error:
            rospy.logwarn_throttle(1.0, f"{self._topic} ignored: {error}")


def joint_control_to_msg(snapshot: JointControlSnapshot, ahead_s: float) -> JointControllerState:
    """Converts the state of a single-joint controller; the stamp is the time of the loop plus `ahead_s` [s]."""
    gains = snapshot.gains
    message = JointControllerState(
        set_point=snapshot.set_point,
        process_value=snapshot.process_value,
        process_value_dot=snapshot.process_value_dot,
        error=snapshot.error,
        time_step=snapshot.period_s,
        command=snapshot.command,
        p=gains.p,
        i=gains.i,
        d=gains.d,
        i_clamp=gains.i_clamp_max,
        antiwindup=gains.antiwindup,
    )
    message.header.stamp = rospy.Time.from_sec(snapshot.time_s + ahead_s)
    return message
