# SPDX-License-Identifier: BSD-3-Clause
"""XML whose elements remember their file and line, so that a fault in a model can be pointed at."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TypeVar

from modular_framework_simulation.errors import DescriptionError
from modular_framework_urdf import xml_text

Choice = TypeVar("Choice", bound=Enum)

_LATE_DECLARATION = re.compile(r"(?:\s|<!--(?:(?!-->).)*-->)+(<\?xml\b[^>]*\?>)", re.DOTALL)
_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")


@dataclass(slots=True)
class XmlNode:
    """One element of a description.

    Attributes:
        tag: Element name.
        attributes: Attribute values by name.
        source: File (or other origin) the element stands in.
        line: Line in that source, from 1.
        text: Text directly inside the element.
        children: Elements inside, in order.
    """

    tag: str
    attributes: dict[str, str]
    source: str
    line: int
    text: str = ""
    children: list[XmlNode] = field(default_factory=list)

    @property
    def where(self) -> str:
        """Source, line and element, as an error message starts."""
        name = self.attributes.get("name")
        label = f"<{self.tag} name='{name}'>" if name is not None else f"<{self.tag}>"
        return f"{self.source}:{self.line}: {label}"

    def find(self, tag: str) -> XmlNode | None:
        """Returns the first child element of that name, None if there is none."""
        return next((child for child in self.children if child.tag == tag), None)

    def find_all(self, tag: str) -> list[XmlNode]:
        """Returns all child elements of that name."""
        return [child for child in self.children if child.tag == tag]

    def find_path(self, *tags: str) -> XmlNode | None:
        """Returns the element reached by following the first child of each name."""
        node: XmlNode | None = self
        for tag in tags:
            node = node.find(tag) if node is not None else None
        return node

    def require(self, tag: str) -> XmlNode:
        """Returns the first child of that name.

        Raises:
            DescriptionError: There is none.
        """
        child = self.find(tag)
        if child is None:
            got = ", ".join(f"<{each.tag}>" for each in self.children) or "nothing"
            raise DescriptionError(self.where, f"has no <{tag}>", f"a <{tag}> is needed here, got {got}")
        return child

    def name(self) -> str:
        """Returns the attribute `name`.

        Raises:
            DescriptionError: It is missing or empty.
        """
        value = self.attributes.get("name", "")
        if not value:
            raise DescriptionError(self.where, "has no name", "give it a non-empty attribute 'name'")
        return value

    def numbers(self, count: int) -> tuple[float, ...]:
        """Returns the text as that many finite numbers.

        Raises:
            DescriptionError: Another count, or something that is not a finite number.
        """
        return parse_numbers(self.where, self.text, count)

    def number_list(self, least: int, most: int) -> tuple[float, ...]:
        """Returns the text as finite numbers, as many as there are within two bounds.

        Raises:
            DescriptionError: Another count, or something that is not a finite number.
        """
        count = min(max(len(self.text.split()), least), most)
        return parse_numbers(self.where, self.text, count)

    def number(self) -> float:
        """Returns the text as one finite number."""
        return self.numbers(1)[0]

    def choice(self, attribute: str, choices: type[Choice], what: str) -> Choice:
        """Returns the value of an attribute as one of the members of an Enum.

        Raises:
            DescriptionError: It is none of them.
        """
        value = self.attributes.get(attribute, "")
        try:
            return choices(value)
        except ValueError as error:
            allowed = ", ".join(each.value for each in choices)
            raise DescriptionError(self.where, f"got {what} '{value}'", f"allowed: {allowed}") from error

    def flag(self) -> bool:
        """Returns the text as a bool.

        Raises:
            DescriptionError: Neither true, false, 1 nor 0.
        """
        value = self.text.strip().lower()
        if value in ("true", "1"):
            return True
        if value in ("false", "0"):
            return False
        raise DescriptionError(self.where, f"got '{value}'", "allowed: true, false, 1, 0")


def parse_numbers(where: str, text: str, count: int) -> tuple[float, ...]:
    """Returns a text as that many finite numbers.

    Args:
        where: Named in the error.
        text: Numbers separated by white space.
        count: How many there have to be.

    Raises:
        DescriptionError: Another count, or something that is not a finite number.
    """
    words = text.split()
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(words) != count or len(values) != count or not all(math.isfinite(value) for value in values):
        raise DescriptionError(where, f"got '{text.strip()}'", f"expected {count} finite number(s)")
    return values


def parse_xml(text: str, source: str) -> XmlNode:
    """Parses a document.

    Args:
        text: The XML.
        source: Where it comes from, for messages.

    Returns:
        The root element.

    Raises:
        DescriptionError: The text is not well-formed XML, or has a DOCTYPE.
    """
    try:
        return _node(xml_text.parse(_begun_properly(text), source), source)
    except xml_text.XmlError as error:
        raise DescriptionError(error.where, error.found, error.allowed) from error


def _begun_properly(text: str) -> str:
    """Returns a document without a byte order mark, and without a declaration behind empty lines or comments.

    Gazebo reads both; the numbers of the lines stay as they are.
    """
    text = text.removeprefix("\ufeff")
    late = _LATE_DECLARATION.match(text)
    if late is None:
        return text
    return text[: late.start(1)] + "\n" * late.group(1).count("\n") + text[late.end(1) :]


def _node(element: xml_text.Element, source: str) -> XmlNode:
    text = "".join([element.text or "", *(child.tail or "" for child in element)])
    children = [_node(child, source) for child in element]
    return XmlNode(element.tag, dict(element.attrib), source, element.sourceline, text, children)


def read_xml(path: Path) -> XmlNode:
    """Parses a file.

    Raises:
        DescriptionError: It cannot be read or is not well-formed XML.
    """
    try:
        text = _decoded(path.read_bytes())
    except (OSError, UnicodeDecodeError, LookupError) as error:
        raise DescriptionError(str(path), f"cannot be read ({error})", "give a readable XML file") from error
    return parse_xml(text, str(path))


def _decoded(content: bytes) -> str:
    """Returns the text of a file, in the encoding that its first bytes or its declaration name; UTF-8 without."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    declared = _ENCODING.match(content)
    return content.decode(declared.group(1).decode("ascii") if declared is not None else "utf-8")
