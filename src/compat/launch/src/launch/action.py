# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of actions."""

from __future__ import annotations

from launch.core.action import Action

__all__ = [
    "Action",
]
