# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch description."""

from __future__ import annotations

from launch.actions.launch_description import LaunchDescription

__all__ = [
    "LaunchDescription",
]
