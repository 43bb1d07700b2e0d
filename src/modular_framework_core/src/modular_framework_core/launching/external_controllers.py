# SPDX-License-Identifier: BSD-3-Clause
"""Reads from the parameters which node drives the manipulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_ros.node_handle import ParameterError

PACKAGE_KEY = "package_manipulator_action_server"
TYPE_KEY = "manipulator_controller_action_server_type"
NAME_KEY = "manipulator_controller_node_name"


@dataclass(frozen=True, slots=True)
class ControllerNode:
    """A node: executable ``node_type`` of a ROS package, and node name."""

    package: str
    node_type: str
    name: str


def controller_node(parameters: Mapping[str, object]) -> ControllerNode | None:
    """Returns the node that drives the manipulator, or None if a ros_control plug-in drives it (empty package).

    Args:
        parameters: Values of the keys above, if set.

    Raises:
        ParameterError: A required parameter is not set or empty.
    """
    if PACKAGE_KEY not in parameters:
        raise ParameterError(
            f"parameter '{PACKAGE_KEY}' is not set; set it to the package of the "
            "manipulator's action server, or to an empty text when a ros_control plug-in "
            "drives it"
        )
    package = str(parameters[PACKAGE_KEY] or "")
    if not package:
        return None
    missing = [key for key in (TYPE_KEY, NAME_KEY) if not parameters.get(key)]
    if missing:
        raise ParameterError(
            f"the parameters {missing} are not set or empty; they name the executable and "
            f"the node of package '{package}'"
        )
    return ControllerNode(package, str(parameters[TYPE_KEY]), str(parameters[NAME_KEY]))
