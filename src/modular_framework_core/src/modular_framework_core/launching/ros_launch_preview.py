# SPDX-License-Identifier: BSD-3-Clause
"""Reads the nodes and parameters of a launch file without starting anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import roslaunch.config
import roslaunch.core
import roslaunch.xmlloader

from modular_framework_core.launching.external_controllers import controller_node
from modular_framework_core.launching.launch_arguments import argument_values
from modular_framework_ros.node_handle import ParameterError

CONTROLLERS_SPAWNER = "external_controllers_spawner"
CHECKED_ARGUMENTS = "checked_arguments"
"""Parameter whose command checks the launch arguments while roslaunch loads the file."""


@dataclass(frozen=True, slots=True)
class LaunchedNode:
    """A node of a launch.

    Attributes:
        package: ROS package.
        executable: Executable in the package.
        name: Resolved name, from /.
        namespace: Namespace, with a trailing /.
        arguments: Command-line arguments.
        machine: Name of the machine that runs the node; "" if not given.
    """

    package: str
    executable: str
    name: str
    namespace: str
    arguments: str = ""
    machine: str = ""


@dataclass(frozen=True, slots=True)
class LaunchPreview:
    """Nodes and parameters of a launch.

    Attributes:
        nodes: Nodes of the launch.
        parameters: Parameter values by resolved name.
        arguments: Values of the arguments of the launch file by name.
    """

    nodes: tuple[LaunchedNode, ...]
    parameters: Mapping[str, Any]
    arguments: Mapping[str, str] = field(default_factory=dict)

    def with_parameters(self, overrides: Mapping[str, Any]) -> LaunchPreview:
        """Returns a copy with overridden parameters; nested mappings are flattened."""
        return replace(self, parameters={**self.parameters, **leaves(overrides)})

    def below(self, name: str) -> dict[str, Any]:
        """Returns the parameters below a resolved name as nested dicts."""
        result: dict[str, Any] = {}
        for key, value in self.parameters.items():
            if key.startswith(f"{name}/"):
                *path, last = key.removeprefix(f"{name}/").split("/")
                branch = result
                for part in path:
                    branch = branch.setdefault(part, {})
                branch[last] = value
        return result


def leaves(parameters: Mapping[str, Any], parent: str = "") -> dict[str, Any]:
    """Returns the leaves of nested parameters by full name.

    Args:
        parameters: Nested parameters.
        parent: Name of the parent; "" at the top level.
    """
    result: dict[str, Any] = {}
    for key, value in parameters.items():
        name = f"{parent}/{key}" if parent else str(key)
        result |= leaves(value, name) if isinstance(value, Mapping) and value else {name: value}
    return result


class _PreviewLoader(roslaunch.xmlloader.XmlLoader):  # type: ignore[misc]
    """XML loader without the check of the launch arguments, so that parameters are checked despite argument faults."""

    def param_value(self, verbose: bool, name: str, *source: Any) -> Any:
        return "" if name == CHECKED_ARGUMENTS else super().param_value(verbose, name, *source)


def preview_launch(path: str, arguments: Sequence[str], later_files: Sequence[str] = ()) -> LaunchPreview:
    """Returns the nodes and parameters of a launch file. Names of anonymous nodes are not resolved.

    Args:
        path: Launch file.
        arguments: Launch arguments, `name:=value`.
        later_files: Launch files loaded afterwards with the same arguments.

    Raises:
        roslaunch.core.RLException: The launch file or a file that it loads is invalid.
    """
    loader = _PreviewLoader(resolve_anon=False)
    config = roslaunch.config.load_config_default(
        [(file, list(arguments)) for file in (path, *later_files)],
        None,
        loader=loader,
        verbose=False,
        assign_machines=False,
    )
    nodes = [
        LaunchedNode(
            node.package,
            node.type,
            f"{node.namespace}{node.name}",
            node.namespace,
            str(node.args),
            node.machine_name or "",
        )
        for node in config.nodes
    ]
    parameters = leaves({name: item.value for name, item in config.params.items()})
    if any(node.executable == CONTROLLERS_SPAWNER for node in nodes):
        try:
            spawned = controller_node({name.removeprefix("/"): value for name, value in parameters.items()})
        except ParameterError as error:
            raise roslaunch.core.RLException(f"{path}: {error}") from error
        if spawned is not None:
            nodes.append(LaunchedNode(spawned.package, spawned.node_type, f"/{spawned.name}", "/"))
    return LaunchPreview(tuple(nodes), parameters, argument_values(path, list(arguments)))
