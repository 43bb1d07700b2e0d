# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions of constant texts, values of the context, and unique names."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable
from typing import ClassVar

from launch.core.errors import SubstitutionFailure, hint, listed
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution, TextSubstitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions, perform_text

__all__ = [
    "AnonName",
    "EnvironmentVariable",
    "LaunchConfiguration",
    "LocalSubstitution",
    "SubstitutionOfText",
    "TextSubstitution",
    "ThisLaunchFile",
    "ThisLaunchFileDir",
    "described",
]


def described(subs: Iterable[Substitution]) -> str:
    """Returns a description of substitutions."""
    return " + ".join(each.describe() for each in subs)


class SubstitutionOfText(Substitution):
    """Base class of substitutions whose value depends on one text.

    Attributes:
        label: Name of the substitution in `describe`; empty for the name of the class.

    Args:
        text: The text, with substitutions.
    """

    label: ClassVar[str] = ""

    def __init__(self, text: SomeSubstitutionsType) -> None:
        self._text = normalize_to_list_of_substitutions(text)

    @property
    def text(self) -> list[Substitution]:
        """Returns the text; subclasses provide it under the name in ROS 2."""
        return self._text

    def describe(self) -> str:
        return f"{self.label or type(self).__name__}({described(self._text)})"

    def perform(self, context: LaunchContext) -> str:
        return self._value(context, perform_substitutions(context, self._text))

    def _value(self, context: LaunchContext, text: str) -> str:
        """Returns the value for a text in a launch context."""
        raise NotImplementedError(f"{type(self).__name__} has no value; define _value(context, text)")


class LaunchConfiguration(SubstitutionOfText):
    """Value of a launch configuration or launch argument.

    Args:
        variable_name: Name of the configuration.
        default: Value of a configuration that is not set.
    """

    label = "LaunchConfig"
    variable_name = SubstitutionOfText.text

    def __init__(self, variable_name: SomeSubstitutionsType, *, default: object = None) -> None:
        super().__init__(variable_name)
        self._default: list[Substitution] | None = None
        if default is not None:
            several = isinstance(default, Iterable) and not isinstance(default, str)
            parts = list(default) if several else [default]  # type: ignore[call-overload]
            self._default = normalize_to_list_of_substitutions(
                [each if isinstance(each, Substitution) else str(each) for each in parts]
            )

    def _value(self, context: LaunchContext, name: str) -> str:
        value = context.read_configuration(name)
        if value is not None:
            return str(value)
        if self._default is not None:
            return perform_substitutions(context, self._default)
        known = context.launch_configurations
        raise SubstitutionFailure(
            f"launch configuration '{name}' is not set{hint(name, known)}; set: {listed(known)}; declare it "
            f"before with DeclareLaunchArgument('{name}', default_value=...), or give LaunchConfiguration a default"
        )


class EnvironmentVariable(SubstitutionOfText):
    """Value of an environment variable.

    Args:
        name: Name of the variable.
        default_value: Value of a variable that is not set.
    """

    label = "EnvVar"

    def __init__(self, name: SomeSubstitutionsType, *, default_value: SomeSubstitutionsType | None = None) -> None:
        super().__init__(name)
        self._default = default_value

    def _value(self, context: LaunchContext, name: str) -> str:
        if name in context.environment:
            return context.environment[name]
        if self._default is not None:
            return perform_text(context, self._default)
        raise SubstitutionFailure(
            f"environment variable '{name}' is not set{hint(name, context.environment)}; set it, or give "
            "EnvironmentVariable a default_value"
        )


class LocalSubstitution(Substitution):
    """Value in the context's `locals`, such as `event.returncode` in an event handler.

    Args:
        expression: Attributes, separated by dots.
        description: Text that represents the substitution in messages.
    """

    def __init__(self, expression: str, description: str | None = None) -> None:
        self._expression = expression
        self._description = description or expression

    def describe(self) -> str:
        return f"Local('{self._description}')"

    def perform(self, context: LaunchContext) -> str:
        value = context.locals
        try:
            for attribute in self._expression.split("."):
                value = getattr(value, attribute)
        except AttributeError as error:
            raise SubstitutionFailure(f"LocalSubstitution('{self._expression}'): {error}") from None
        return str(value)


class ThisLaunchFile(Substitution):
    """Path of the current launch file."""

    def perform(self, context: LaunchContext) -> str:
        path = context.get_locals_as_dict().get("current_launch_file_path")
        if path is None:
            raise SubstitutionFailure("ThisLaunchFile: this description does not come from a file; use a path instead")
        return str(path)


class ThisLaunchFileDir(ThisLaunchFile):
    """Folder of the current launch file."""

    def perform(self, context: LaunchContext) -> str:
        return os.path.dirname(super().perform(context))


class AnonName(SubstitutionOfText):
    """Unique name of a process; the same base name gives the same name within a launch.

    Args:
        name: Base name.
    """

    def __init__(self, name: SomeSubstitutionsType) -> None:
        super().__init__(name)

    def _value(self, context: LaunchContext, name: str) -> str:
        key = f"anon{name}"
        if key not in context.launch_configurations:
            host = "".join(each if each.isalnum() else "_" for each in socket.gethostname())
            context.launch_configurations[key] = f"{name}_{host}_{os.getpid()}_{os.urandom(4).hex()}"
        return str(context.launch_configurations[key])
