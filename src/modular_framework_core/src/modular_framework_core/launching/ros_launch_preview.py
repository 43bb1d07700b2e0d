# SPDX-License-Identifier: BSD-3-Clause
"""Loads a launch file without starting anything: which nodes it would start, and with which parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import roslaunch.config
import roslaunch.core
import roslaunch.xmlloader

from modular_framework_core.launching.external_controllers import controller_node
from modular_framework_ros.node_handle import ParameterError

CONTROLLERS_SPAWNER = "external_controllers_spawner"
CHECKED_ARGUMENTS = "checked_arguments"
"""Parameter whose command checks the arguments when roslaunch loads the file."""


@dataclass(frozen=True, slots=True)
class LaunchedNode:
    """A node that a launch starts.

    Attributes:
        package: Its package.
        executable: Its executable.
        name: Its whole name, from /.
        namespace: Its namespace, with / at the end.
        arguments: Its arguments.
    """

    package: str
    executable: str
    name: str
    namespace: str
    arguments: str = ""


@dataclass(frozen=True, slots=True)
class LaunchPreview:
    """What a launch starts.

    Attributes:
        nodes: The nodes.
        parameters: Values by whole name.
    """

    nodes: tuple[LaunchedNode, ...]
    parameters: Mapping[str, Any]

    def with_parameters(self, given: Mapping[str, Any]) -> LaunchPreview:
        """Returns the preview with parameters that replace those of the launch file; mappings count by their leaves."""
        return replace(self, parameters={**self.parameters, **leaves(given)})

    def below(self, name: str) -> dict[str, Any]:
        """Returns the parameters below a whole name, nested."""
        result: dict[str, Any] = {}
        for key, value in self.parameters.items():
            if key.startswith(f"{name}/"):
                *path, last = key.removeprefix(f"{name}/").split("/")
                inner = result
                for part in path:
                    inner = inner.setdefault(part, {})
                inner[last] = value
        return result


def leaves(parameters: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Returns parameters by whole name, those of mappings one by one."""
    result: dict[str, Any] = {}
    for key, value in parameters.items():
        name = f"{above}/{key}" if above else str(key)
        result |= leaves(value, name) if isinstance(value, Mapping) and value else {name: value}
    return result


class _PreviewLoader(roslaunch.xmlloader.XmlLoader):  # type: ignore[misc]
    """Loads a launch file without the check of its arguments, so that faults of parameters are found beside theirs."""

    def param_value(self, verbose: bool, name: str, *source: Any) -> Any:
        return "" if name == CHECKED_ARGUMENTS else super().param_value(verbose, name, *source)


def preview_launch(path: str, arguments: Sequence[str]) -> LaunchPreview:
    """Returns what a launch file would start; equal for equal files, so names of anonymous nodes are as in the file.

    Args:
        path: The launch file.
        arguments: Launch arguments, `name:=value`.

    Raises:
        roslaunch.core.RLException: The launch file or something that it reads cannot be used.
    """
    loader = _PreviewLoader(resolve_anon=False)
    config = roslaunch.config.load_config_default(
        [(path, list(arguments))], None, loader=loader, verbose=False, assign_machines=False
    )
    nodes = [
        LaunchedNode(node.package, node.type, f"{node.namespace}{node.name}", node.namespace, str(node.args))
        for node in config.nodes
    ]
    parameters = leaves({name: item.value for name, item in config.params.items()})
    if any(node.executable == CONTROLLERS_SPAWNER for node in nodes):
        try:
            own = controller_node({name.removeprefix("/"): value for name, value in parameters.items()})
        except ParameterError as error:
            raise roslaunch.core.RLException(f"{path}: {error}") from error
        if own is not None:
            nodes.append(LaunchedNode(own.package, own.node_type, f"/{own.name}", "/"))
    return LaunchPreview(tuple(nodes), parameters)
