# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch's logger."""

from __future__ import annotations

from launch.core.screen_log import get_logger

__all__ = [
    "get_logger",
]
