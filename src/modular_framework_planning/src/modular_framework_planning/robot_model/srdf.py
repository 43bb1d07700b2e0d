# SPDX-License-Identifier: BSD-3-Clause
"""Semantic robot description (SRDF), with the planner's errors."""

from __future__ import annotations

from modular_framework_planning.errors import ModelError
from modular_framework_urdf.srdf_reader import SemanticDescription, read_srdf
from modular_framework_urdf.xml_text import XmlError


def parse_srdf(text: str) -> SemanticDescription:
    """Parses an SRDF document.

    Raises:
        ModelError: The text is not XML, has a DOCTYPE, or an element lacks an attribute.
    """
    try:
        return read_srdf(text)
    except XmlError as error:
        raise ModelError(f"{error} (is robot_description_semantic loaded?)") from error
