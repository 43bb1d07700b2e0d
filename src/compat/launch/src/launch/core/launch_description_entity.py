# SPDX-License-Identifier: BSD-3-Clause
"""What a launch description is made of: actions, and descriptions themselves."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.launch_context import LaunchContext


class LaunchDescriptionEntity:
    """Something that is visited, in order, when a description is launched."""

    def visit(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity] | None:
        """Does what the entity is for; returns the entities to visit next, before those that follow this one."""
        del context
        return None

    def describe(self) -> str:
        """Returns a short text for messages."""
        return type(self).__name__

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Returns the entities inside that are visited whatever the configuration is."""
        return []

    def describe_conditional_sub_entities(self) -> list[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        """Returns what decides about entities inside, and those entities."""
        return []
