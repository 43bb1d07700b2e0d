# SPDX-License-Identifier: BSD-3-Clause
"""Reads the declared parameters of a running node from the parameter server."""

from __future__ import annotations

import rospy

from modular_framework_ros.parameter_declarations import DeclarationError, ParameterReader, node_declaration


class DeclaredParameters(ParameterReader):
    """The parameters of a node on the parameter server.

    Args:
        package: Package of the node.
        node: Its executable.

    Raises:
        DeclarationError: The package declares no parameters of the node, or not as it should.
    """

    def __init__(self, package: str, node: str) -> None:
        found = node_declaration(package, node)
        if found is None:
            raise DeclarationError(f"there is no {package}/parameters/{node}.yaml")
        super().__init__(found, lambda name: rospy.get_param(name, None), rospy.resolve_name)
