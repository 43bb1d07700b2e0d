# SPDX-License-Identifier: BSD-3-Clause
"""Actions, which a launch description executes in order."""

from __future__ import annotations

from launch.actions.configurations import (
    DeclareLaunchArgument,
    PopLaunchConfigurations,
    PushLaunchConfigurations,
    ResetLaunchConfigurations,
    SetLaunchConfiguration,
    UnsetLaunchConfiguration,
)
from launch.actions.environment import (
    AppendEnvironmentVariable,
    PopEnvironment,
    PushEnvironment,
    ResetEnvironment,
    SetEnvironmentVariable,
    UnsetEnvironmentVariable,
)
from launch.actions.events import EmitEvent, RegisterEventHandler, Shutdown, TimerAction, UnregisterEventHandler
from launch.actions.execute_process import ExecuteLocal, ExecuteProcess
from launch.actions.functions import LogInfo, OpaqueFunction
from launch.actions.grouping import GroupAction, IncludeLaunchDescription
from launch.core.errors import unsupported_names

__all__ = [
    "AppendEnvironmentVariable",
    "DeclareLaunchArgument",
    "EmitEvent",
    "ExecuteLocal",
    "ExecuteProcess",
    "GroupAction",
    "IncludeLaunchDescription",
    "LogInfo",
    "OpaqueFunction",
    "PopEnvironment",
    "PopLaunchConfigurations",
    "PushEnvironment",
    "PushLaunchConfigurations",
    "RegisterEventHandler",
    "ResetEnvironment",
    "ResetLaunchConfigurations",
    "SetEnvironmentVariable",
    "SetLaunchConfiguration",
    "Shutdown",
    "TimerAction",
    "UnregisterEventHandler",
    "UnsetEnvironmentVariable",
    "UnsetLaunchConfiguration",
]

UNSUPPORTED = {"OpaqueCoroutine": "the launch has no asyncio loop; use OpaqueFunction, or a separate process"}
"""Unsupported actions of ROS 2, with the alternative for the error message."""

__getattr__ = unsupported_names("launch.actions", UNSUPPORTED)
