# SPDX-License-Identifier: BSD-3-Clause
"""Actions on launch configurations: arguments with defaults, values, and scopes."""

from __future__ import annotations

from collections.abc import Iterable, MutableMapping
from typing import Any

from launch.actions.named_values import SetNamedValue, UnsetNamedValue
from launch.core.action import Action
from launch.core.errors import LaunchError, hint
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions, perform_text


class DeclareLaunchArgument(Action):
    """Declares a launch argument, which becomes a launch configuration of the same name.

    Args:
        name: Name of the argument.
        default_value: Default value; an argument without a default must be given.
        description: Description of the argument.
        choices: Allowed values; None for all values.
    """

    def __init__(
        self,
        name: str,
        *,
        default_value: SomeSubstitutionsType | None = None,
        description: str | None = None,
        choices: Iterable[str] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self._name = name
        self._default = None if default_value is None else normalize_to_list_of_substitutions(default_value)
        self._choices = None if choices is None else list(choices)
        self._description = description or ""
        self.conditionally_included = False
        if self._choices is not None:
            if not self._choices:
                raise self._error("choices is empty; allowed: at least one value; leave choices out to allow all")
            if isinstance(default_value, str) and default_value not in self._choices:
                raise self._error(f"default_value is '{default_value}'; {self._allowed_choices(default_value)}")

    @property
    def name(self) -> str:
        """Returns the name of the argument."""
        return self._name

    @property
    def default_value(self) -> list[Substitution] | None:
        """Returns the default value."""
        return self._default

    @property
    def description(self) -> str:
        """Returns the description, including the allowed values."""
        text = self._description or ("" if self._choices else "no description given")
        if not self._choices:
            return text
        allowed = f"Valid choices are: {self._choices}"
        return f"{text.rstrip('.')}. {allowed}" if text else allowed

    @property
    def choices(self) -> list[str] | None:
        """Returns the allowed values; None for all values."""
        return self._choices

    def describe(self) -> str:
        return f"DeclareLaunchArgument('{self._name}')"

    def execute(self, context: LaunchContext) -> None:
        context.declared_arguments.add(self._name)
        configurations = context.launch_configurations
        if self._name not in configurations:
            if self._default is None:
                about = f" ({self._description})" if self._description else ""
                raise self._error(f"argument '{self._name}'{about} has no value; give {self._name}:=VALUE")
            configurations[self._name] = perform_substitutions(context, self._default)
        value = configurations[self._name]
        if self._choices is not None and value not in self._choices:
            raise self._error(f"argument '{self._name}' is '{value}'; {self._allowed_choices(str(value))}")

    def _allowed_choices(self, value: str) -> str:
        choices = self._choices or []
        return f"allowed: {', '.join(choices)}{hint(value, choices)}; give an allowed value"

    def _error(self, message: str) -> LaunchError:
        error = LaunchError(message)
        error.where = self.where
        return error


class SetLaunchConfiguration(SetNamedValue):
    """Sets a launch configuration.

    Args:
        name: Name of the configuration.
        value: Value of the configuration.
    """

    def _values(self, context: LaunchContext) -> MutableMapping[str, Any]:
        return context.launch_configurations


class UnsetLaunchConfiguration(UnsetNamedValue):
    """Removes a launch configuration.

    Args:
        name: Name of the configuration.
    """

    def _values(self, context: LaunchContext) -> MutableMapping[str, Any]:
        return context.launch_configurations


class PushLaunchConfigurations(Action):
    """Starts a scope of launch configurations."""

    def execute(self, context: LaunchContext) -> None:
        context.push_launch_configurations()


class PopLaunchConfigurations(Action):
    """Ends a scope of launch configurations."""

    def execute(self, context: LaunchContext) -> None:
        context.pop_launch_configurations()


class ResetLaunchConfigurations(Action):
    """Removes all launch configurations and sets new configurations.

    Args:
        launch_configurations: New configurations by name, evaluated before the removal.
    """

    def __init__(
        self,
        launch_configurations: dict[SomeSubstitutionsType, SomeSubstitutionsType] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self._kept = dict(launch_configurations or {})

    def execute(self, context: LaunchContext) -> None:
        kept = {perform_text(context, name): perform_text(context, value) for name, value in self._kept.items()}
        context.launch_configurations.clear()
        context.launch_configurations.update(kept)
