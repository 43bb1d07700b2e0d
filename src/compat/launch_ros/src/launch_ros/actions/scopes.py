# SPDX-License-Identifier: BSD-3-Clause
"""Actions that apply to all later nodes in the same scope: namespace, parameters and remappings."""

from __future__ import annotations

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

from launch_ros.actions.node import NAMESPACE, PARAMETERS, REMAPPINGS
from launch_ros.namespaces import join
from launch_ros.node_parameters import CLOCK, evaluate_sources
from launch_ros.parameter_descriptions import evaluate_value


class PushROSNamespace(Action):
    """Sets the namespace of later nodes, until the end of the enclosing group.

    Args:
        namespace: Namespace, absolute or relative to the pushed namespace.
    """

    def __init__(self, namespace: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._namespace = normalize_to_list_of_substitutions(namespace)

    def execute(self, context: LaunchContext) -> None:
        configurations = context.launch_configurations
        configurations[NAMESPACE] = join(configurations.get(NAMESPACE), perform_substitutions(context, self._namespace))


PushRosNamespace = PushROSNamespace


class SetParameter(Action):
    """Sets a parameter of later nodes, until the end of the enclosing group.

    Args:
        name: Name of the parameter.
        value: Value of the parameter; a node's own parameters override it.
    """

    def __init__(self, name: SomeSubstitutionsType, value: Any, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._name = normalize_to_list_of_substitutions(name)
        self._value = value

    def execute(self, context: LaunchContext) -> None:
        name = perform_substitutions(context, self._name)
        value = evaluate_value(context, self._value, None, f"parameter {name}")
        configurations = context.launch_configurations
        configurations[PARAMETERS] = [*configurations.get(PARAMETERS, ()), {name: value}]


class SetParametersFromFile(Action):
    """Sets the parameters in a YAML file for later nodes, until the end of the enclosing group.

    Args:
        filename: Path of the file.
    """

    def __init__(self, filename: Any, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._filename = filename

    def execute(self, context: LaunchContext) -> None:
        configurations = context.launch_configurations
        sources = evaluate_sources(context, [self._filename])
        configurations[PARAMETERS] = [*configurations.get(PARAMETERS, ()), *sources]


class SetRemap(Action):
    """Remaps a name for later nodes, until the end of the enclosing group.

    Args:
        src: Old name.
        dst: New name.
    """

    def __init__(self, src: SomeSubstitutionsType, dst: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._src, self._dst = src, dst

    def execute(self, context: LaunchContext) -> None:
        pair = (perform_text(context, self._src), perform_text(context, self._dst))
        configurations = context.launch_configurations
        configurations[REMAPPINGS] = [*configurations.get(REMAPPINGS, ()), pair]


class SetUseSimTime(Action):
    """Sets whether nodes use the time of `/clock`; on ROS 1, the setting applies to all nodes of a master.

    Args:
        value: Whether nodes use the time of `/clock`.
    """

    def __init__(self, value: bool | SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._value = value

    def execute(self, context: LaunchContext) -> None:
        value = perform_boolean(context, self._value, "SetUseSimTime")
        context.parameters.set(f"/{CLOCK}", value, self.where, shared=True)
