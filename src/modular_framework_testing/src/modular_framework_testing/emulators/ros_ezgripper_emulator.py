# SPDX-License-Identifier: BSD-3-Clause
"""Runs an emulated EZGripper on a pseudo-terminal as a ROS node."""

from __future__ import annotations

from pathlib import Path

import rospy

from modular_framework_control.realtime.scheduling import run_in_real_time
from modular_framework_drivers.ezgripper.gripper_servos import ticks_from_joint
from modular_framework_drivers.ezgripper.gripper_settings import read_gripper_settings
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.ros_node_handle import RosNodeHandle
from modular_framework_testing.emulators.command_port import CommandPort
from modular_framework_testing.emulators.dynamixel_finger import Finger
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo
from modular_framework_testing.emulators.ros_emulator_node import offer_commands, run_emulator

_PRIORITY, _LINE_PRIORITY = 40, 30


class EzGripperEmulatorNode:
    """Node `ezgripper_emulator`.

    Parameters: see `parameters/ezgripper_emulator.yaml`; `~port_name` is the path of the serial port. The object
    appears between the fingers once they have closed and opened.

    Services (std_srvs/Trigger): `~<command>` for every command without required arguments.
    """

    def __init__(self) -> None:
        handle = RosNodeHandle("~")
        settings = read_gripper_settings(handle, handle)
        read = DeclaredParameters("modular_framework_testing", "ezgripper_emulator").values
        position, held_at, command_port = read("~position", "~object", "~command_port")
        opening = ticks_from_joint(position)
        word = round(2e6 / settings.baudrate) - 1
        fingers = [Finger(DynamixelServo(servo_id, word), opening=opening) for servo_id in settings.servo_ids]
        self._line = DynamixelLine(fingers, Path(settings.port_name))
        if held_at >= 0.0:
            self._line.offer_object(held_at)
        self._commands = CommandPort(self._line.commands, command_port)
        self._services: list[rospy.Service] = []

    def connect(self) -> None:
        """Connects the serial line, opens the command port and advertises the services.

        Raises:
            OSError: If the path or the command port is in use; the text names it.
        """
        self._commands.connect()
        self._line.connect()
        self._services = offer_commands(self._line.commands)
        rospy.loginfo(
            "emulated gripper at %s; commands at TCP port %d (`help` lists them)", self._line.link, self._commands.port
        )

    def run(self) -> None:
        """Serves until the node is shut down, in real time if permitted, then disconnects the serial line."""
        run_in_real_time(_PRIORITY, _LINE_PRIORITY)  # servos respond on time even on a busy computer
        rospy.spin()
        self._commands.close()
        self._line.close()


def main() -> int:
    """Runs the node; returns its exit code."""
    return run_emulator("ezgripper_emulator", EzGripperEmulatorNode)
