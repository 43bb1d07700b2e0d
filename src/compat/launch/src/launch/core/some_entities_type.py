# SPDX-License-Identifier: BSD-3-Clause
"""Type of one or several entities."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.launch_description_entity import LaunchDescriptionEntity

SomeEntitiesType = LaunchDescriptionEntity | Iterable[LaunchDescriptionEntity]
SomeEntitiesType_types_tuple = (LaunchDescriptionEntity, Iterable)
