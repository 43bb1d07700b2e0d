# SPDX-License-Identifier: BSD-3-Clause
"""Action, an entity that is executed when a description is launched, optionally on a condition."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.condition import Condition
from launch.core.errors import LaunchError, line_of_launch_file, located_error, require_type
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity


class Action(LaunchDescriptionEntity):
    """Base class of actions.

    Args:
        condition: Condition of the execution; None to execute always.

    Attributes:
        where: File and line of the launch file that created the action.
    """

    def __init__(self, *, condition: Condition | None = None) -> None:
        self.where = line_of_launch_file()
        if condition is not None:
            what = f"{self.where}: {type(self).__name__}: condition"
            require_type(condition, Condition, what, "a condition of launch.conditions, such as IfCondition(...)")
        self._condition = condition

    @property
    def condition(self) -> Condition | None:
        """Returns the condition of the execution."""
        return self._condition

    def visit(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity] | None:
        """Executes the action if its condition holds; errors get the line of the launch file."""
        try:
            if self._condition is not None and not self._condition.evaluate(context):
                return None
            return self.execute(context)
        except LaunchError as error:
            error.where = error.where or self.where
            raise
        except Exception as error:  # functions of a launch file may raise anything
            raise located_error(self.describe(), error, self.where) from error

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity] | None:
        """Executes the action; returns the entities to visit next."""
        del context
        return None

    def get_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Returns the contained entities that are known before the launch."""
        return []

    def describe_sub_entities(self) -> list[LaunchDescriptionEntity]:
        return self.get_sub_entities() if self._condition is None else []

    def describe_conditional_sub_entities(self) -> list[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        if self._condition is None:
            return []
        return [(self._condition.describe(), self.get_sub_entities())]
