# SPDX-License-Identifier: BSD-3-Clause
"""Reads the declared parameters of a running node from the parameter server."""

from __future__ import annotations

import rospy

from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration


class DeclaredParameters(ParameterReader):
    """The parameters of a node on the parameter server.

    Args:
        package: Package of the node.
        node: Its executable.

    Raises:
        DeclarationError: The package declares no parameters of the node, or not as it should.
    """

    def __init__(self, package: str, node: str) -> None:
        super().__init__(
            existing_declaration(package, node), lambda name: rospy.get_param(name, None), rospy.resolve_name
        )
