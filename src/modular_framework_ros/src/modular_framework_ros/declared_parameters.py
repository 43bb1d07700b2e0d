# SPDX-License-Identifier: BSD-3-Clause
"""Reads the declared parameters of a running node from the parameter server."""

from __future__ import annotations

from typing import Any

import rospy

from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration

_LOG_PERIOD_S = 10.0


class DeclaredParameters(ParameterReader):
    """The declared parameters of a node on the parameter server.

    Args:
        package: Package of the node.
        node: Executable of the node.

    Raises:
        DeclarationError: The package has no valid declaration for the node.
    """

    def __init__(self, package: str, node: str) -> None:
        super().__init__(
            existing_declaration(package, node), lambda name: rospy.get_param(name, None), rospy.resolve_name
        )

    def value_or_default(self, name: str) -> Any:
        """Returns the value of a parameter, or its default after logging an error if the value is not allowed.

        Args:
            name: Declared name of the parameter.
        """
        try:
            return self.value(name)
        except ParameterError as error:
            default = self.declaration(name).default
            rospy.logerr_throttle_identical(_LOG_PERIOD_S, f"{error}; {default} is used")
            return default
