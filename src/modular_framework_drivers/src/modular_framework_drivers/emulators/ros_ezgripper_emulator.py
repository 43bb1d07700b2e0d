# SPDX-License-Identifier: BSD-3-Clause
"""An emulated EZGripper on a pseudo-terminal, as a ROS node."""

from __future__ import annotations

from pathlib import Path

import rospy

from modular_framework_drivers.emulators.command_port import CommandPort
from modular_framework_drivers.emulators.dynamixel_finger import Finger
from modular_framework_drivers.emulators.dynamixel_line import DynamixelLine
from modular_framework_drivers.emulators.dynamixel_servo import DynamixelServo
from modular_framework_drivers.emulators.ros_emulator_node import offer_commands, run_emulator
from modular_framework_drivers.ezgripper.gripper_servos import ticks_from_joint
from modular_framework_drivers.ezgripper.gripper_settings import read_gripper_settings
from modular_framework_ros.node_handle import read_number
from modular_framework_ros.ros_node_handle import RosNodeHandle

COMMAND_PORT = 29900


class EzGripperEmulatorNode:
    """Node `ezgripper_emulator`.

    Parameters: `~port_name`: path under which the serial port is found; `~baudrate` [bit/s] 57600 and `~servo_ids` [1]
    of the servos; `~position` [rad] 0.5: where the knuckle joint is at first; `~object` [rad] -1: position of the
    knuckle joint at which an object stops the fingers, once they have been shut and opened, negative for none;
    `~command_port` 29900: TCP port of the commands.

    Services (std_srvs/Trigger): `~<command>` for every command that needs no argument.
    """

    def __init__(self) -> None:
        handle = RosNodeHandle("~")
        settings = read_gripper_settings(handle, handle)
        opening = ticks_from_joint(read_number(handle, "position", 0.5))
        word = round(2e6 / settings.baudrate) - 1
        fingers = [Finger(DynamixelServo(servo_id, word), opening=opening) for servo_id in settings.servo_ids]
        self._line = DynamixelLine(fingers, Path(settings.port_name))
        held_at = read_number(handle, "object", -1.0, None)
        if held_at >= 0.0:
            self._line.offer_object(held_at)
        self._commands = CommandPort(self._line.commands, int(read_number(handle, "command_port", COMMAND_PORT)))
        self._services: list[rospy.Service] = []

    def connect(self) -> None:
        """Plug the line in, listen, and offer the services.

        Raises:
            OSError: the path or the command port is taken; the text names it.
        """
        self._commands.connect()
        self._line.connect()
        self._services = offer_commands(self._line.commands)
        rospy.loginfo(
            "emulated gripper at %s; commands at TCP port %d (`help` lists them)", self._line.link, self._commands.port
        )

    def run(self) -> None:
        """Serves until the node is shut down, then pulls the plug."""
        rospy.spin()
        self._commands.close()
        self._line.close()


def main() -> int:
    """Runs the node; returns its exit code."""
    return run_emulator("ezgripper_emulator", EzGripperEmulatorNode)
