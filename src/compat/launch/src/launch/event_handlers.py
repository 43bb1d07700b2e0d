# SPDX-License-Identifier: BSD-3-Clause
"""Event handlers for the start and the end of processes, and for the end of the launch."""

from __future__ import annotations

from launch.actions.process_handlers import OnProcessExit, OnProcessStart, OnShutdown
from launch.core.errors import refusal_of

__all__ = [
    "OnProcessExit",
    "OnProcessStart",
    "OnShutdown",
]

NOT_OFFERED = {
    "OnProcessIO": "the output of processes goes to the screen or to a log file, not through the launch",
    "OnExecutionComplete": "use OnProcessExit for processes; other actions are complete when the next one is visited",
    "OnIncludeLaunchDescription": "put the actions before the IncludeLaunchDescription",
}
"""Event handlers of ROS 2 that are refused, with what to do."""

__getattr__ = refusal_of("launch.event_handlers", NOT_OFFERED)
