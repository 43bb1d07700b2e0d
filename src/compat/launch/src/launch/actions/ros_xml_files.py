# SPDX-License-Identifier: BSD-3-Clause
"""XML launch files of roslaunch in launch descriptions; roslaunch reads the files, this package starts the nodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import roslaunch.arg_dump
import roslaunch.config
import roslaunch.core
import roslaunch.loader
import roslaunch.xmlloader
import rospkg

from launch.actions.configurations import DeclareLaunchArgument
from launch.actions.launch_description import LaunchDescription
from launch.core.action import Action
from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.process_request import ProcessRequest
from launch.core.screen_log import get_logger

NAMESPACE, REMAPPINGS = "ros_namespace", "ros_remaps"
"""Launch configurations with the current namespace and the current remappings."""
_READ_ERRORS = (
    roslaunch.core.RLException,
    roslaunch.xmlloader.XmlParseException,
    roslaunch.loader.LoadException,
    rospkg.ResourceNotFound,
    ValueError,
)


def describe_xml_file(path: str) -> LaunchDescription:
    """Returns a description that declares the arguments of an XML launch file and launches the file.

    Raises:
        LaunchError: The file is not a valid launch file.
    """
    try:
        known: dict[str, tuple[str | None, str | None]] = roslaunch.arg_dump.get_args([path])
    except _READ_ERRORS as error:
        raise LaunchError(f"{path}: {error}") from error
    # Only roslaunch can evaluate expressions in defaults, so defaults are not evaluated here.
    arguments = [_XmlArgument(name, description=doc, xml_default=default) for name, (doc, default) in known.items()]
    description = LaunchDescription([*arguments, XmlLaunchFile(path, tuple(known))])
    description.takes_only_declared = True
    return description


class _XmlArgument(DeclareLaunchArgument):
    """Declares an argument of an XML launch file, whose default roslaunch evaluates.

    Args:
        name: Name of the argument.
        description: Description of the argument.
        xml_default: Default in the file; None for an argument that must be given.
    """

    def __init__(self, name: str, *, description: str | None, xml_default: str | None) -> None:
        super().__init__(name, default_value=xml_default, description=description)

    def execute(self, context: LaunchContext) -> None:
        context.declared_arguments.add(self.name)


class XmlLaunchFile(Action):
    """Plans the parameters of an XML launch file and requests its nodes.

    Args:
        path: Path of the file.
        argument_names: Names of its arguments, which get the values of launch configurations of the same name.
    """

    def __init__(self, path: str, argument_names: tuple[str, ...]) -> None:
        super().__init__()
        self._path = path
        self._names = argument_names
        self.where = path

    def describe(self) -> str:
        return f"XmlLaunchFile({self._path})"

    def execute(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        configurations = context.launch_configurations
        values = {name: str(configurations[name]) for name in self._names if name in configurations}
        config = self._load(values, configurations.get(NAMESPACE), configurations.get(REMAPPINGS, ()))
        for name in config.clear_params:
            context.parameters.clear(name)
        for name, parameter in config.params.items():
            context.parameters.set(name, parameter.value, self._path)
        for node in config.nodes:
            if node.machine_name:
                raise LaunchError(
                    f"node '{node.name}' is for machine '{node.machine_name}'; allowed: nodes of this computer; use "
                    "roslaunch to start it on the other machine"
                )
            full_name = f"{node.namespace}{node.name}"
            request = ProcessRequest(None, full_name.lstrip("/"), [], node_name=full_name, roslaunch_node=node)
            context.requests.append(request)
        return []

    def _load(self, values: Mapping[str, str], namespace: str | None, remappings: Any) -> Any:
        """Reads the file with roslaunch, as included in a namespace with remappings.

        Args:
            values: Values of arguments, by name.
            namespace: Namespace of the file; None for the root namespace.
            remappings: Pairs of old and new name.
        """
        arguments = "".join(f"<arg name={quoteattr(name)} value={quoteattr(values[name])}/>" for name in values)
        remaps = "".join(f"<remap from={quoteattr(old)} to={quoteattr(new)}/>" for old, new in remappings)
        group = f"<group ns={quoteattr(namespace)}>" if namespace and namespace != "/" else "<group>"
        text = f"<launch>{group}{remaps}<include file={quoteattr(self._path)}>{arguments}</include></group></launch>"
        config = roslaunch.config.ROSLaunchConfig()
        try:
            roslaunch.xmlloader.XmlLoader().load_string(text, config, verbose=False)
        except _READ_ERRORS as error:
            raise LaunchError(f"{self._path}: {error}") from error
        for warning in config.config_errors:
            get_logger().warning("%s: %s", self._path, warning)
        return config
