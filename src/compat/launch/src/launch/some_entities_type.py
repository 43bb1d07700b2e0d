# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the type of one or several entities."""

from __future__ import annotations

from launch.core.some_entities_type import SomeEntitiesType, SomeEntitiesType_types_tuple

__all__ = [
    "SomeEntitiesType",
    "SomeEntitiesType_types_tuple",
]
