# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch context."""

from __future__ import annotations

from launch.core.launch_context import LaunchContext

__all__ = [
    "LaunchContext",
]
