# SPDX-License-Identifier: BSD-3-Clause
"""Provides the main function of the emulator nodes, and their commands as ROS services."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_ros.node_handle import ParameterError
from modular_framework_testing.emulators.command_port import Command


class EmulatorNode(Protocol):
    """Interface of an emulator node."""

    def connect(self) -> None:
        """Opens the ports and services for clients."""

    def run(self) -> None:
        """Serves until the node is shut down."""


def run_emulator(name: str, make_node: Callable[[], EmulatorNode]) -> int:
    """Runs an emulator until ROS shuts down.

    Args:
        name: Name of the ROS node.
        make_node: Callback that reads the parameters and returns the node.

    Returns:
        The exit code: 1 if a parameter is invalid or a port is in use; the cause is logged.
    """
    rospy.init_node(name)
    try:
        node = make_node()
        node.connect()
    except (ParameterError, OSError, ValueError, TypeError) as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    node.run()
    return 0


def offer_commands(commands: Mapping[str, Command]) -> list[rospy.Service]:
    """Advertises `~<command>` (std_srvs/Trigger) for every command without required arguments."""
    return [
        rospy.Service(f"~{name}", Trigger, _CommandService(command))
        for name, command in commands.items()
        if all(one.default is not one.empty for one in inspect.signature(command).parameters.values())
    ]


class _CommandService:
    """Callback of a service that runs a command."""

    def __init__(self, command: Command) -> None:
        self._command = command

    def __call__(self, request: Any) -> TriggerResponse:
        del request
        try:
            return TriggerResponse(success=True, message=self._command() or "")
        except (OSError, ValueError) as error:
            return TriggerResponse(success=False, message=str(error))
