# SPDX-License-Identifier: BSD-3-Clause
"""Public names of event handlers."""

from __future__ import annotations

from launch.core.event_handler import BaseEventHandler, EventHandler

__all__ = [
    "BaseEventHandler",
    "EventHandler",
]
