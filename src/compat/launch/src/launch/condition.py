# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of conditions."""

from __future__ import annotations

from launch.core.condition import Condition

__all__ = [
    "Condition",
]
