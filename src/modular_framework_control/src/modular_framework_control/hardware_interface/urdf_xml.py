# SPDX-License-Identifier: BSD-3-Clause
"""Robot description parsing with ParameterError for faults."""

from __future__ import annotations

from modular_framework_ros.node_handle import ParameterError
from modular_framework_urdf.robot import Robot
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError


def parse_description(description: str, where: str = "robot_description") -> Robot:
    """Reads a robot description.

    Args:
        description: XML text.
        where: Name of the description in messages.

    Raises:
        ParameterError: The text is not well-formed XML, has a DOCTYPE, or a value is not a number.
    """
    try:
        return read_urdf(description, where)
    except XmlError as error:
        raise ParameterError(str(error)) from error
