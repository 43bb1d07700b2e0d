# SPDX-License-Identifier: BSD-3-Clause
"""Base class of launch description entities: actions and descriptions."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.launch_context import LaunchContext


class LaunchDescriptionEntity:
    """Entity that is visited, in order, when a description is launched."""

    def visit(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity] | None:
        """Executes the entity; returns the entities to visit next, before the following entities."""
        del context
        return None

    def describe(self) -> str:
        """Returns a short text for messages."""
        return type(self).__name__

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Returns the contained entities that are visited in any configuration."""
        return []

    def describe_conditional_sub_entities(self) -> list[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        """Returns the contained entities that are visited on a condition, with descriptions of the conditions."""
        return []
