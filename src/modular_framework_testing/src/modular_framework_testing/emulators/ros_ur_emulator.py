# SPDX-License-Identifier: BSD-3-Clause
"""Runs the emulated controller of a UR arm as a ROS node."""

from __future__ import annotations

import rospy

from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_testing.emulators.ros_emulator_node import offer_commands, run_emulator
from modular_framework_testing.emulators.ur_emulator import UrEmulator


class UrEmulatorNode:
    """Node `ur_emulator`.

    Parameters: see `parameters/ur_emulator.yaml`.

    Services (std_srvs/Trigger): `~<command>` for every command without required arguments; the other commands are only
    available at the command port.
    """

    def __init__(self) -> None:
        read = DeclaredParameters("modular_framework_testing", "ur_emulator").values
        *arm, self._log = read("~address", "~model", "~positions", "~unlock_delay", "~command_port", "~log")
        self._emulator = UrEmulator(*arm)

    def connect(self) -> None:
        """Opens the ports and advertises the services.

        Raises:
            OSError: If a port is in use; the text names the port.
        """
        self._emulator.connect()
        if self._log:
            self._emulator.commands["log"](path=self._log)
        offer_commands(self._emulator.commands)

    def run(self) -> None:
        """Serves until the node is shut down."""
        rospy.on_shutdown(self._emulator.stop)
        self._emulator.run()
        self._emulator.close()


def main() -> int:
    """Runs the node; returns its exit code."""
    return run_emulator("ur_emulator", UrEmulatorNode)
