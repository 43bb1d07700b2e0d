# SPDX-License-Identifier: BSD-3-Clause
"""The robot description, with the kind of error that controllers and hardware raise for wrong parameters."""

from __future__ import annotations

from modular_framework_ros.node_handle import ParameterError
from modular_framework_urdf.robot import Robot
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError


def parse_description(description: str, where: str = "robot_description") -> Robot:
    """Reads a robot description.

    Args:
        description: the XML text.
        where: what to call it in messages.

    Raises:
        ParameterError: not well-formed XML, it has a DOCTYPE, or something in it is no number.
    """
    try:
        return read_urdf(description, where)
    except XmlError as error:
        raise ParameterError(str(error)) from error
