# SPDX-License-Identifier: BSD-3-Clause
"""Shared parts of the emulator nodes: their main function, and the commands as ROS services."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_drivers.emulators.command_port import Command
from modular_framework_ros.node_handle import ParameterError


class EmulatorNode(Protocol):
    """The node of an emulator."""

    def connect(self) -> None:
        """Opens what clients connect to."""

    def run(self) -> None:
        """Serves until the node is shut down."""


def run_emulator(name: str, make_node: Callable[[], EmulatorNode]) -> int:
    """Runs an emulator until ROS ends it.

    Args:
        name: of the ROS node.
        make_node: reads its parameters.

    Returns:
        The exit code: 1 when a parameter is wrong or a port is taken, which is logged.
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
    """Advertises `~<command>` (std_srvs/Trigger) for every command that needs no argument."""
    return [
        rospy.Service(f"~{name}", Trigger, _CommandService(command))
        for name, command in commands.items()
        if all(one.default is not one.empty for one in inspect.signature(command).parameters.values())
    ]


class _CommandService:
    """A command as the callback of a service."""

    def __init__(self, command: Command) -> None:
        self._command = command

    def __call__(self, request: Any) -> TriggerResponse:
        del request
        try:
            return TriggerResponse(success=True, message=self._command() or "")
        except (OSError, ValueError) as error:
            return TriggerResponse(success=False, message=str(error))
