# SPDX-License-Identifier: BSD-3-Clause
"""Event handlers for starts and exits of processes, and for the shutdown of the launch."""

from __future__ import annotations

from launch.actions.process_handlers import OnProcessExit, OnProcessStart, OnShutdown
from launch.core.errors import unsupported_names

__all__ = [
    "OnProcessExit",
    "OnProcessStart",
    "OnShutdown",
]

UNSUPPORTED = {
    "OnProcessIO": "processes write their output to the screen or to a log file, not through the launch",
    "OnExecutionComplete": "use OnProcessExit for processes; other actions end before the next action is visited",
    "OnIncludeLaunchDescription": "move the actions before the IncludeLaunchDescription",
}
"""Unsupported event handlers of ROS 2, with the alternative for the error message."""

__getattr__ = unsupported_names("launch.event_handlers", UNSUPPORTED)
