# SPDX-License-Identifier: BSD-3-Clause
"""Parses the XML of robot descriptions with line numbers and refuses document types.

A document type is refused because its entities may expand without bound. Elements in a default namespace
(`<robot xmlns="...">`) and elements with an undeclared prefix (`<ignition:topic>`) keep their names as written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.parsers import expat

from lxml import etree

XACRO_TAGS = ("xacro:", "{http://www.ros.org/wiki/xacro", "{http://ros.org/wiki/xacro")
"""Prefixes of xacro tags, which do not occur in an expanded file."""
Element = Any
"""An lxml element; `sourceline` is the first line of its start tag, from 1."""
_MAX_LINE = 65_534
"""Largest line number that lxml stores; for later lines, `sourceline` is approximately the end of the tag."""


class XmlError(ValueError):
    """A document is invalid.

    Args:
        location: Name of the document and line.
        found: Fault.
        allowed: Allowed content and remedy.
    """

    def __init__(self, location: str, found: str, allowed: str) -> None:
        super().__init__(f"{location}: {found}; {allowed}")
        self.location, self.found, self.allowed = location, found, allowed


def refuse_doctype(text: str | bytes, location: str) -> None:
    """Raises XmlError if a document has a DOCTYPE, without expanding any entity.

    Args:
        text: XML text, which need not be well-formed.
        location: Name of the file or parameter, for messages.
    """
    _scan(text, location)


def _scan(text: str | bytes, location: str) -> tuple[list[int], Exception | None]:
    """Returns the line of each start tag and a syntax error, if any; raises XmlError for a DOCTYPE."""
    parser = expat.ParserCreate()
    lines: list[int] = []

    def refuse(*_: object) -> None:
        raise XmlError(
            f"{location}:{parser.CurrentLineNumber}",
            "got a DOCTYPE",
            "allowed: XML without a DOCTYPE, because its entities could fill the memory; remove it",
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
    try:
        parser.Parse(text, True)
    except XmlError:
        raise
    except (expat.ExpatError, LookupError, ValueError) as fault:  # LookupError, ValueError: unknown encoding
        return lines, fault
    return lines, None


def parse(text: str | bytes, location: str) -> Element:
    """Returns the root element of a document without comments and processing instructions.

    Args:
        text: XML text.
        location: Name of the file or parameter, for messages.

    Raises:
        XmlError: The text is not well-formed XML or has a DOCTYPE.
    """
    lines, error = _scan(text, location)
    if error is not None:
        raise _syntax_error(location, getattr(error, "lineno", 1), error) from error
    is_text = isinstance(text, str)
    parser = etree.XMLParser(
        encoding="utf-8" if is_text else None,  # a declared encoding does not apply to decoded text
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
        huge_tree=not is_text,  # mesh files exceed libxml2's default size limit
        recover=True,  # accepts undeclared prefixes
    )
    try:
        root = etree.fromstring(text.encode() if isinstance(text, str) else text, parser)
    except etree.XMLSyntaxError as fault:
        raise _syntax_error(location, fault.lineno, fault.msg) from fault
    for entry in parser.error_log.filter_from_errors():
        if entry.domain != etree.ErrorDomains.NAMESPACE:  # libxml2's limits of depth and size
            raise _syntax_error(location, entry.line, entry.message)
    try:
        _name_as_written(root)
    except ValueError as error:  # a name such as `a::b`
        raise _syntax_error(location, 1, error) from error
    for element, line in zip(root.iter(), lines, strict=True):
        if line <= _MAX_LINE:
            element.sourceline = line
    return root


def _syntax_error(location: str, line: int | None, fault: object) -> XmlError:
    return XmlError(
        f"{location}:{line or 1}",
        f"not an XML document (not well-formed XML: {fault})",
        "it must be well-formed XML; correct it",
    )


def _name_as_written(root: Element) -> None:
    """Removes default namespaces from the element names."""
    for element in root.iter():
        if element.prefix is None and element.tag.startswith("{"):
            element.tag = etree.QName(element).localname
    etree.cleanup_namespaces(root)


def read(path: Path) -> Element:
    """Returns the root element of a file.

    Raises:
        OSError: The file cannot be read.
        XmlError: The file is not well-formed XML or has a DOCTYPE.
    """
    return parse(path.read_bytes(), str(path))


def add_child(parent: Element, tag: str, **attributes: str) -> Element:
    """Appends an element to a parent element and returns the new element."""
    return etree.SubElement(parent, tag, attributes)


def to_text(root: Element) -> str:
    """Returns a parsed document as text."""
    text: str = etree.tostring(root, encoding="unicode")
    return text
