# SPDX-License-Identifier: BSD-3-Clause
"""Actions that contain other actions: a group with its own scope, and an included launch file."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from launch.actions.configurations import (
    PopLaunchConfigurations,
    PushLaunchConfigurations,
    ResetLaunchConfigurations,
    SetLaunchConfiguration,
)
from launch.actions.environment import PopEnvironment, PushEnvironment, ResetEnvironment
from launch.actions.launch_description import LaunchDescription
from launch.actions.launch_description_source import LaunchDescriptionSource
from launch.actions.launch_file_sources import AnyLaunchDescriptionSource
from launch.core.action import Action
from launch.core.errors import LaunchError, hint, listed
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import normalize_to_list_of_entities, perform_text


class GroupAction(Action):
    """Executes several actions under one condition and in one scope.

    Args:
        actions: The actions.
        scoped: Whether configurations and environment are restored after the group.
        forwarding: Whether a scoped group inherits the configurations of the enclosing scope.
        launch_configurations: Initial configurations, by name.
    """

    def __init__(
        self,
        actions: Iterable[LaunchDescriptionEntity],
        *,
        scoped: bool = True,
        forwarding: bool = True,
        launch_configurations: dict[SomeSubstitutionsType, SomeSubstitutionsType] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        self._actions = normalize_to_list_of_entities(actions)
        self._scoped = scoped
        self._forwarding = forwarding
        self._configurations = dict(launch_configurations or {})

    def get_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Returns the actions, enclosed by the actions that start and end the scope."""
        settings: list[LaunchDescriptionEntity] = [
            SetLaunchConfiguration(name, value) for name, value in self._configurations.items()
        ]
        if not self._scoped:
            return [*settings, *self._actions]
        if not self._forwarding:
            settings = [ResetEnvironment(), ResetLaunchConfigurations(self._configurations)]
        begin = [PushLaunchConfigurations(), PushEnvironment()]
        return [*begin, *settings, *self._actions, PopEnvironment(), PopLaunchConfigurations()]

    def execute(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        del context
        return self.get_sub_entities()


class _SetLaunchFile(Action):
    """Sets the launch file that is being visited."""

    def __init__(self, path: str | None) -> None:
        super().__init__()
        self._path = path

    def execute(self, context: LaunchContext) -> None:
        folder = None if self._path is None else os.path.dirname(self._path)
        context.extend_locals({"current_launch_file_path": self._path, "current_launch_file_directory": folder})


class IncludeLaunchDescription(Action):
    """Includes another launch file, in Python or roslaunch's XML.

    Arguments and configurations of the file remain set after it, as in ROS 2; use a GroupAction to restore them.

    Args:
        launch_description_source: The launch file, as a source or a path.
        launch_arguments: Pairs of name and value (`{...}.items()`), or a mapping.
    """

    def __init__(
        self,
        launch_description_source: LaunchDescriptionSource | SomeSubstitutionsType,
        *,
        launch_arguments: Any = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        source = launch_description_source
        self._source = source if isinstance(source, LaunchDescriptionSource) else AnyLaunchDescriptionSource(source)
        given = launch_arguments if launch_arguments is not None else ()
        self._arguments = tuple(given.items() if isinstance(given, dict) else given)

    @property
    def launch_description_source(self) -> LaunchDescriptionSource:
        """Returns the source of the launch file."""
        return self._source

    @property
    def launch_arguments(self) -> tuple[tuple[SomeSubstitutionsType, SomeSubstitutionsType], ...]:
        """Returns the pairs of argument name and value."""
        return self._arguments

    def describe(self) -> str:
        return f"IncludeLaunchDescription({self._source.location})"

    def get_sub_entities(self) -> list[LaunchDescriptionEntity]:
        """Returns the description if its path is known before the launch."""
        description = self._source.try_get_launch_description_without_context()
        return [] if description is None else [description]

    def execute(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        names = [perform_text(context, name) for name, _ in self._arguments]
        values = [perform_text(context, value) for _, value in self._arguments]
        description = self._source.get_launch_description(context)
        path = os.path.abspath(self._source.location)
        self._check_required(description, {*names, *context.launch_configurations}, path)
        if description.takes_only_declared:
            _check_declared(description, names, path)
        settings = [SetLaunchConfiguration(name, value) for name, value in zip(names, values, strict=True)]
        before = context.get_locals_as_dict().get("current_launch_file_path")
        return [_SetLaunchFile(path), *settings, description, _SetLaunchFile(before)]

    @staticmethod
    def _check_required(description: LaunchDescription, given: set[str], path: str) -> None:
        """Checks that all arguments without a default have a value, before the file is visited."""
        for argument in description.get_launch_arguments():
            if argument.default_value is None and not argument.conditionally_included and argument.name not in given:
                raise LaunchError(
                    f"{path} requires the argument '{argument.name}' ({argument.description}), which is not given"
                    f"{hint(argument.name, given)}; given: {listed(given)}; add it to launch_arguments"
                )


def _check_declared(description: LaunchDescription, names: Iterable[str], path: str) -> None:
    declared = [argument.name for argument in description.get_launch_arguments()]
    for name in names:
        if name not in declared:
            raise LaunchError(
                f"{path} has no argument '{name}'{hint(name, declared)}; allowed: {listed(declared)}; correct or "
                "remove it"
            )
