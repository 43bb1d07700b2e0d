# SPDX-License-Identifier: BSD-3-Clause
"""Public name of what may stand where entities are wanted."""

from __future__ import annotations

from launch.core.some_entities_type import SomeEntitiesType, SomeEntitiesType_types_tuple

__all__ = [
    "SomeEntitiesType",
    "SomeEntitiesType_types_tuple",
]
