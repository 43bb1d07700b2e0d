# SPDX-License-Identifier: BSD-3-Clause
"""Reads a robot description so that each element knows its line, for messages.

Names stand as they are written: a description with a default namespace (`<robot xmlns="...">`) reads like one without.
"""
from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from xml.parsers import expat

from modular_framework_ros.node_handle import ParameterError
from modular_framework_urdf.xml_text import XmlError, refuse_doctype


class LocatedElement(ElementTree.Element):
    """An element of a description.

    Attributes:
        line: where it begins, from 1.
    """

    line = 0


def parse_description(description: str, where: str = "robot_description") -> ElementTree.Element:
    """The root element of a description; it and all below it are `LocatedElement`s.

    Args:
        description: the XML text.
        where: what to call it in messages.

    Raises:
        ParameterError: not well-formed XML, or it has a DOCTYPE.
    """
    builder = ElementTree.TreeBuilder(element_factory=LocatedElement)
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = builder.start(tag, attributes)
        if isinstance(element, LocatedElement):
            element.line = parser.CurrentLineNumber

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        refuse_doctype(description, where)
        parser.Parse(description, True)
    except XmlError as error:
        raise ParameterError(str(error)) from error
    except expat.ExpatError as error:
        raise ParameterError(f"{where}: not well-formed XML ({error})") from error
    return builder.close()


def line_of(element: ElementTree.Element) -> int:
    """Line in which an element that `parse_description` made begins."""
    return element.line if isinstance(element, LocatedElement) else 0
