# SPDX-License-Identifier: BSD-3-Clause
"""Actions that change the environment of the processes that come after them."""

from __future__ import annotations

import os
from typing import Any

from launch.core.action import Action
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import (
    normalize_to_list_of_substitutions,
    perform_boolean,
    perform_substitutions,
    perform_text,
)


class SetEnvironmentVariable(Action):
    """Sets an environment variable.

    Args:
        name: Its name.
        value: Its value.
    """

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._name = normalize_to_list_of_substitutions(name)
        self._value = normalize_to_list_of_substitutions(value)

    def execute(self, context: LaunchContext) -> None:
        name = perform_substitutions(context, self._name)
        context.environment[name] = perform_substitutions(context, self._value)


class AppendEnvironmentVariable(Action):
    """Adds a value to an environment variable.

    Args:
        name: Its name.
        value: The value to add.
        prepend: Whether it comes first.
        separator: What stands between the values.
    """

    def __init__(
        self,
        name: SomeSubstitutionsType,
        value: SomeSubstitutionsType,
        prepend: bool | SomeSubstitutionsType = False,
        separator: SomeSubstitutionsType = os.pathsep,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self._name, self._value, self._prepend, self._separator = name, value, prepend, separator

    def execute(self, context: LaunchContext) -> None:
        name, value = perform_text(context, self._name), perform_text(context, self._value)
        parts = [context.environment[name], value] if name in context.environment else [value]
        if perform_boolean(context, self._prepend, f"prepend of environment variable {name}"):
            parts.reverse()
        context.environment[name] = perform_text(context, self._separator).join(parts)


class UnsetEnvironmentVariable(Action):
    """Removes an environment variable.

    Args:
        name: Its name.
    """

    def __init__(self, name: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._name = normalize_to_list_of_substitutions(name)

    def execute(self, context: LaunchContext) -> None:
        context.environment.pop(perform_substitutions(context, self._name), None)


class PushEnvironment(Action):
    """Begins a scope of the environment."""

    def execute(self, context: LaunchContext) -> None:
        context.push_environment()


class PopEnvironment(Action):
    """Ends a scope of the environment."""

    def execute(self, context: LaunchContext) -> None:
        context.pop_environment()


class ResetEnvironment(Action):
    """Puts the environment back that the launch began with."""

    def execute(self, context: LaunchContext) -> None:
        context.reset_environment()
