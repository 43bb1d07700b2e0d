# SPDX-License-Identifier: BSD-3-Clause
"""Launch description, the return value of a launch file."""

from __future__ import annotations

from collections.abc import Iterable

from launch.actions.configurations import DeclareLaunchArgument
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.utilities import normalize_to_list_of_entities


class LaunchDescription(LaunchDescriptionEntity):
    """Sequence of entities that are visited in order.

    Args:
        initial_entities: Initial entities.
        deprecated_reason: Reason for the deprecation of the description; None if not deprecated.

    Attributes:
        takes_only_declared: Whether undeclared arguments are errors.
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
        """Returns the entities."""
        return self._entities

    @property
    def deprecated_reason(self) -> str | None:
        """Returns the reason for the deprecation of the description."""
        return self._deprecated_reason

    def add_entity(self, entity: LaunchDescriptionEntity) -> None:
        """Appends an entity."""
        self._entities.extend(normalize_to_list_of_entities(entity))

    def add_action(self, action: LaunchDescriptionEntity) -> None:
        """Appends an action."""
        self.add_entity(action)

    def visit(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        del context
        return list(self._entities)

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        return list(self._entities)

    def get_launch_arguments(self, conditional_inclusion: bool = False) -> list[DeclareLaunchArgument]:
        """Returns the known launch arguments of this description and of included descriptions.

        Args:
            conditional_inclusion: Whether this description is only visited on a condition.

        Returns:
            One action per name; its `conditionally_included` is true if the action depends on a condition.
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
