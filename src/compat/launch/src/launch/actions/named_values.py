# SPDX-License-Identifier: BSD-3-Clause
"""Base classes of actions that set or remove a named value, such as a configuration or an environment variable."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import MutableMapping
from typing import Any

from launch.core.action import Action
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions


class NamedValueAction(Action):
    """Base class of actions on a named value.

    Args:
        name: Name of the value.
    """

    def __init__(self, name: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._name = normalize_to_list_of_substitutions(name)

    @property
    def name(self) -> list[Substitution]:
        """Returns the name of the value."""
        return self._name

    @abstractmethod
    def _values(self, context: LaunchContext) -> MutableMapping[str, Any]:
        """Returns the mapping that contains the value."""


class SetNamedValue(NamedValueAction):
    """Base class of actions that set a value.

    Args:
        name: Name of the value.
        value: New value.
    """

    def __init__(self, name: SomeSubstitutionsType, value: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._value = normalize_to_list_of_substitutions(value)

    @property
    def value(self) -> list[Substitution]:
        """Returns the new value."""
        return self._value

    def execute(self, context: LaunchContext) -> None:
        name = perform_substitutions(context, self._name)
        self._values(context)[name] = perform_substitutions(context, self._value)


class UnsetNamedValue(NamedValueAction):
    """Base class of actions that remove a value, if set."""

    def execute(self, context: LaunchContext) -> None:
        self._values(context).pop(perform_substitutions(context, self._name), None)
