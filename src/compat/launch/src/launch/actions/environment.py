# SPDX-License-Identifier: BSD-3-Clause
"""Actions on the environment variables of subsequent processes."""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from typing import Any

from launch.actions.named_values import SetNamedValue, UnsetNamedValue
from launch.core.action import Action
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import (
    perform_boolean,
    perform_text,
)


class SetEnvironmentVariable(SetNamedValue):
    """Sets an environment variable.

    Args:
        name: Name of the variable.
        value: Value of the variable.
    """

    def _values(self, context: LaunchContext) -> MutableMapping[str, Any]:
        return context.environment


class AppendEnvironmentVariable(Action):
    """Appends a value to an environment variable.

    Args:
        name: Name of the variable.
        value: Value to append.
        prepend: Whether the value is prepended instead.
        separator: Separator of the values.
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


class UnsetEnvironmentVariable(UnsetNamedValue):
    """Removes an environment variable.

    Args:
        name: Name of the variable.
    """

    def _values(self, context: LaunchContext) -> MutableMapping[str, Any]:
        return context.environment


class PushEnvironment(Action):
    """Starts a scope of the environment."""

    def execute(self, context: LaunchContext) -> None:
        context.push_environment()


class PopEnvironment(Action):
    """Ends a scope of the environment."""

    def execute(self, context: LaunchContext) -> None:
        context.pop_environment()


class ResetEnvironment(Action):
    """Restores the initial environment of the launch."""

    def execute(self, context: LaunchContext) -> None:
        context.reset_environment()
