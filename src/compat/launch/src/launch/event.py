# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of events."""

from __future__ import annotations

from launch.events.event import Event

__all__ = [
    "Event",
]
