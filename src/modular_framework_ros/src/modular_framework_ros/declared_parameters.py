# SPDX-License-Identifier: BSD-3-Clause
"""Reads the declared parameters of a running node; a value that the declaration does not allow is refused."""

from __future__ import annotations

from typing import Any

import rospy

from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import Declaration, node_declaration


class DeclaredParameters:
    """The parameters of a node on the parameter server.

    Args:
        package: Package of the node.
        node: Its executable.
    """

    def __init__(self, package: str, node: str) -> None:
        self._package, self._node = package, node

    def value(self, name: str) -> Any:
        """Returns a parameter; its default if it is not set.

        Args:
            name: As it is declared, with `~` for the node's own.

        Raises:
            ParameterError: It is required and not set, or its value is not allowed.
        """
        declared = self.declaration(name)
        value = rospy.get_param(name, declared.default)
        if value is None and not declared.required:
            return None
        fault = "is not set; allowed: " + declared.allowed if value is None else declared.fault(value)
        if fault:
            raise ParameterError(f"parameter '{rospy.resolve_name(name)}' {fault}")
        return float(value) if declared.type == "float" else value

    def declaration(self, name: str) -> Declaration:
        """Returns the declaration of a parameter; raises KeyError if there is none."""
        found = node_declaration(self._package, self._node)
        if found is None:
            raise KeyError(f"{self._package}/parameters/{self._node}.yaml")
        return found.parameters[name]
