# SPDX-License-Identifier: BSD-3-Clause
"""XML elements that keep their file and line for error messages."""

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

_MISPLACED_DECLARATION = re.compile(r"(?:\s|<!--(?:(?!-->).)*-->)+(<\?xml\b[^>]*\?>)", re.DOTALL)
_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")


@dataclass(slots=True)
class XmlNode:
    """XML element of a description.

    Attributes:
        tag: Tag of the element.
        attributes: Attribute values by name.
        source: File (or other origin) of the element.
        line: Line number in the source, from 1.
        text: Text directly inside the element.
        children: Child elements, in order.
    """

    tag: str
    attributes: dict[str, str]
    source: str
    line: int
    text: str = ""
    children: list[XmlNode] = field(default_factory=list)

    @property
    def location(self) -> str:
        """Returns source, line and tag, for the start of an error message."""
        name = self.attributes.get("name")
        label = f"<{self.tag} name='{name}'>" if name is not None else f"<{self.tag}>"
        return f"{self.source}:{self.line}: {label}"

    def find(self, tag: str) -> XmlNode | None:
        """Returns the first child with a tag; None if no child has the tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def find_all(self, tag: str) -> list[XmlNode]:
        """Returns all children with a tag."""
        return [child for child in self.children if child.tag == tag]

    def find_path(self, *tags: str) -> XmlNode | None:
        """Returns the element at a path of tags, following the first match at each level; None without a match."""
        node: XmlNode | None = self
        for tag in tags:
            node = node.find(tag) if node is not None else None
        return node

    def require(self, tag: str) -> XmlNode:
        """Returns the first child with a tag.

        Raises:
            DescriptionError: No child has the tag.
        """
        child = self.find(tag)
        if child is None:
            children = ", ".join(f"<{each.tag}>" for each in self.children) or "nothing"
            raise DescriptionError(self.location, f"has no <{tag}>", f"a <{tag}> is required, got {children}")
        return child

    def name(self) -> str:
        """Returns the attribute `name`.

        Raises:
            DescriptionError: The attribute is missing or empty.
        """
        value = self.attributes.get("name", "")
        if not value:
            raise DescriptionError(self.location, "has no name", "give it a non-empty attribute 'name'")
        return value

    def numbers(self, count: int) -> tuple[float, ...]:
        """Parses the text as a given number of finite values.

        Raises:
            DescriptionError: The number of values is different, or a value is not a finite number.
        """
        return parse_numbers(self.location, self.text, count)

    def number_list(self, min_count: int, max_count: int) -> tuple[float, ...]:
        """Parses the text as finite values.

        Args:
            min_count: Minimum number of values.
            max_count: Maximum number of values.

        Raises:
            DescriptionError: The number of values is outside the range, or a value is not a finite number.
        """
        count = min(max(len(self.text.split()), min_count), max_count)
        return parse_numbers(self.location, self.text, count)

    def number(self) -> float:
        """Parses the text as one finite number."""
        return self.numbers(1)[0]

    def choice(self, attribute: str, choices: type[Choice], noun: str) -> Choice:
        """Returns the value of an attribute as a member of an Enum.

        Args:
            attribute: Name of the attribute.
            choices: Enum class whose values are the allowed attribute values.
            noun: Description of the attribute for the error message.

        Raises:
            DescriptionError: The value is not an allowed value.
        """
        value = self.attributes.get(attribute, "")
        try:
            return choices(value)
        except ValueError as error:
            allowed = ", ".join(each.value for each in choices)
            raise DescriptionError(self.location, f"got {noun} '{value}'", f"allowed: {allowed}") from error

    def flag(self) -> bool:
        """Parses the text as a bool.

        Raises:
            DescriptionError: The text is not true, false, 1 or 0.
        """
        value = self.text.strip().lower()
        if value in ("true", "1"):
            return True
        if value in ("false", "0"):
            return False
        raise DescriptionError(self.location, f"got '{value}'", "allowed: true, false, 1, 0")


def parse_numbers(location: str, text: str, count: int) -> tuple[float, ...]:
    """Parses a text as a given number of finite values.

    Args:
        location: Location for the error message.
        text: Numbers separated by white space.
        count: Expected number of values.

    Raises:
        DescriptionError: The number of values is different, or a value is not a finite number.
    """
    words = text.split()
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(words) != count or len(values) != count or not all(math.isfinite(value) for value in values):
        raise DescriptionError(location, f"got '{text.strip()}'", f"expected {count} finite number(s)")
    return values


def parse_xml(text: str, source: str) -> XmlNode:
    """Parses a document.

    Args:
        text: XML text.
        source: Origin of the text for messages.

    Returns:
        The root element.

    Raises:
        DescriptionError: The text is not well-formed XML, has a DOCTYPE, or is unexpanded xacro.
    """
    try:
        root = _node(xml_text.parse(_with_valid_start(text), source), source)
    except xml_text.XmlError as error:
        raise DescriptionError(error.location, error.found, error.allowed) from error
    _refuse_xacro(root)
    return root


def _refuse_xacro(node: XmlNode) -> None:
    name = node.attributes.get("name", "")
    if node.tag.startswith(xml_text.XACRO_TAGS) or "${" in name or "$(" in name:
        raise DescriptionError(node.location, "is xacro", "allowed: URDF or SDF; expand the file with xacro first")
    for child in node.children:
        _refuse_xacro(child)


def _with_valid_start(text: str) -> str:
    """Removes a byte order mark, and an XML declaration after blank lines or comments, which Gazebo accepts.

    Line numbers do not change.
    """
    text = text.removeprefix("\ufeff")
    misplaced = _MISPLACED_DECLARATION.match(text)
    if misplaced is None:
        return text
    return text[: misplaced.start(1)] + "\n" * misplaced.group(1).count("\n") + text[misplaced.end(1) :]


def _node(element: xml_text.Element, source: str) -> XmlNode:
    text = "".join([element.text or "", *(child.tail or "" for child in element)])
    children = [_node(child, source) for child in element]
    return XmlNode(element.tag, dict(element.attrib), source, element.sourceline, text, children)


def read_xml(path: Path) -> XmlNode:
    """Parses a file.

    Raises:
        DescriptionError: The file cannot be read or is not well-formed XML.
    """
    try:
        text = _decoded_text(path.read_bytes())
    except (OSError, UnicodeDecodeError, LookupError) as error:
        raise DescriptionError(str(path), f"cannot be read ({error})", "give a readable XML file") from error
    return parse_xml(text, str(path))


def _decoded_text(content: bytes) -> str:
    """Decodes the content of a file with the encoding of its byte order mark or XML declaration; UTF-8 by default."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    declared = _ENCODING.match(content)
    return content.decode(declared.group(1).decode("ascii") if declared is not None else "utf-8")
