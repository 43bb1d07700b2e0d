# SPDX-License-Identifier: BSD-3-Clause
"""Offers the commands of an emulator as ROS services too."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_drivers.emulators.command_port import Command


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
