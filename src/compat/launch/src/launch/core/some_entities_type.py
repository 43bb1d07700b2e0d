# SPDX-License-Identifier: BSD-3-Clause
"""What may stand where entities are wanted: one, or several."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.launch_description_entity import LaunchDescriptionEntity

SomeEntitiesType = LaunchDescriptionEntity | Iterable[LaunchDescriptionEntity]
SomeEntitiesType_types_tuple = (LaunchDescriptionEntity, Iterable)
