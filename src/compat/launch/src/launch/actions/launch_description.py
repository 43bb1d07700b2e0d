# SPDX-License-Identifier: BSD-3-Clause
"""Launch description: what a launch file returns."""

from __future__ import annotations

from collections.abc import Iterable

from launch.actions.configurations import DeclareLaunchArgument
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.utilities import normalize_to_list_of_entities


class LaunchDescription(LaunchDescriptionEntity):
    """Entities that are visited in order.

    Args:
        initial_entities: The first of them.
        deprecated_reason: Why the description should no longer be used; None if it should.

    Attributes:
        takes_only_declared: Whether an argument that it does not declare is a mistake.
    """

    takes_only_declared = False

    def __init__(
        self,
        initial_entities: Iterable[LaunchDescriptionEntity] | None = None,
        *,
        deprecated_reason: str | None = None,
    ) -> None:
        self._entities = normalize_to_list_of_entities(initial_entities)
        self._deprecated_reason = deprecated_reason

    @property
    def entities(self) -> list[LaunchDescriptionEntity]:
        """The entities."""
        return self._entities

    @property
    def deprecated_reason(self) -> str | None:
        """Why the description should no longer be used."""
        return self._deprecated_reason

    def add_entity(self, entity: LaunchDescriptionEntity) -> None:
        """Adds an entity at the end."""
        self._entities.extend(normalize_to_list_of_entities(entity))

    def add_action(self, action: LaunchDescriptionEntity) -> None:
        """Adds an action at the end."""
        self.add_entity(action)

    def visit(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        del context
        return list(self._entities)

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        return list(self._entities)

    def get_launch_arguments(self, conditional_inclusion: bool = False) -> list[DeclareLaunchArgument]:
        """Returns the launch arguments of this description and of those it includes, as far as they are known.

        Args:
            conditional_inclusion: Whether this description itself is visited on a condition only.

        Returns:
            One action a name; `conditionally_included` says whether it is visited on a condition only.
        """
        found: dict[str, DeclareLaunchArgument] = {}
        _collect(self._entities, conditional_inclusion, found)
        return list(found.values())


def _collect(
    entities: Iterable[LaunchDescriptionEntity], conditional: bool, found: dict[str, DeclareLaunchArgument]
) -> None:
    for entity in entities:
        if isinstance(entity, DeclareLaunchArgument):
            entity.conditionally_included = conditional or entity.condition is not None
            found.setdefault(entity.name, entity)
        _collect(entity.describe_sub_entities(), conditional, found)
        for _, inner in entity.describe_conditional_sub_entities():
            _collect(inner, True, found)
