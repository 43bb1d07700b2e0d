# SPDX-License-Identifier: BSD-3-Clause
"""Actions on ROS nodes."""

from __future__ import annotations

from launch.actions import TimerAction as RosTimer
from launch.core.errors import unsupported_names

from launch_ros.actions.node import Node
from launch_ros.actions.scopes import (
    PushROSNamespace,
    PushRosNamespace,
    SetParameter,
    SetParametersFromFile,
    SetRemap,
    SetUseSimTime,
)

__all__ = [
    "Node",
    "PushROSNamespace",
    "PushRosNamespace",
    "RosTimer",
    "SetParameter",
    "SetParametersFromFile",
    "SetRemap",
    "SetUseSimTime",
]

UNSUPPORTED = {
    "ComposableNodeContainer": "ROS 1 has no components; start a Node for each",
    "LoadComposableNodes": "ROS 1 has no components; start a Node for each",
    "LifecycleNode": "nodes of ROS 1 have no life cycle; use Node",
    "LifecycleTransition": "nodes of ROS 1 have no life cycle; use Node",
    "SetROSLogDir": "set the environment variable ROS_LOG_DIR with SetEnvironmentVariable",
}
"""Unsupported actions of ROS 2, with the alternative for the error message."""

__getattr__ = unsupported_names("launch_ros.actions", UNSUPPORTED)
