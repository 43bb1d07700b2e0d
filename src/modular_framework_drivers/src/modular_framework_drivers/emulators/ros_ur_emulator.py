# SPDX-License-Identifier: BSD-3-Clause
"""The emulated controller of a UR arm as a ROS node."""

from __future__ import annotations

import rospy

from modular_framework_drivers.emulators.ros_emulator_node import offer_commands, run_emulator
from modular_framework_drivers.emulators.ur_controller import HOME
from modular_framework_drivers.emulators.ur_emulator import COMMAND_PORT, UrEmulator


class UrEmulatorNode:
    """Node `ur_emulator`.

    Parameters: `~address` "127.0.0.1": where it listens; `~model` UR5 [UR5, UR5e]: decides software version and rate;
    `~positions`: of the joints at the beginning [rad], six numbers; `~unlock_delay` 5.0: time after a protective stop
    before it can be unlocked [s]; `~command_port` 29901; `~log` "": file for the commanded path.

    Services (std_srvs/Trigger): `~<command>` for every command that needs no argument; the others are available at the
    command port only.
    """

    def __init__(self) -> None:
        self._emulator = UrEmulator(
            str(rospy.get_param("~address", "127.0.0.1")),
            str(rospy.get_param("~model", "UR5")),
            [float(value) for value in rospy.get_param("~positions", list(HOME))],
            float(rospy.get_param("~unlock_delay", 5.0)),
            int(rospy.get_param("~command_port", COMMAND_PORT)),
        )

    def connect(self) -> None:
        """Listen, and offer the services.

        Raises:
            OSError: a port is taken; the text names it.
        """
        self._emulator.connect()
        log = str(rospy.get_param("~log", ""))
        if log:
            self._emulator.commands["log"](path=log)
        offer_commands(self._emulator.commands)

    def run(self) -> None:
        """Serve until the node is shut down."""
        rospy.on_shutdown(self._emulator.stop)
        self._emulator.run()
        self._emulator.close()


def main() -> int:
    """Runs the node; returns its exit code."""
    return run_emulator("ur_emulator", UrEmulatorNode)
