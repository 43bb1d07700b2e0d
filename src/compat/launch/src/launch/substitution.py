# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of substitutions."""

from __future__ import annotations

from launch.core.substitution import Substitution

__all__ = [
    "Substitution",
]
