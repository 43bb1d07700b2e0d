# SPDX-License-Identifier: BSD-3-Clause
"""Public name of what the launch says on the screen."""

from __future__ import annotations

from launch.core.screen_log import get_logger

__all__ = [
    "get_logger",
]
