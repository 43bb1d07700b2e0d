# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of launch file sources."""

from __future__ import annotations

from launch.actions.launch_description_source import LaunchDescriptionSource

__all__ = [
    "LaunchDescriptionSource",
]
