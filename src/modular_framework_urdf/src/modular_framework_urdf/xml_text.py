# SPDX-License-Identifier: BSD-3-Clause
"""Parses the XML of descriptions so that each element knows its line, and refuses every document type.

The entities of a document type may grow without bound. Elements of a default namespace (`<robot xmlns="...">`), and
those whose prefix is not declared (`<ignition:topic>`), are called as they are written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.parsers import expat

from lxml import etree

XACRO_TAGS = ("xacro:", "{http://www.ros.org/wiki/xacro", "{http://ros.org/wiki/xacro")
"""Beginnings of the tags of xacro, which are gone in an expanded file."""
Element = Any
"""An lxml element; `sourceline` is the line where its start tag begins, from 1."""
_LAST_LINE = 65_534
"""libxml2 keeps larger lines in another place, which lxml does not set; there it is about where the tag ends."""


class XmlError(ValueError):
    """A text is no XML this project reads.

    Args:
        where: the text and its line; found: what is wrong there; allowed: what would do, and what to do about it.
    """

    def __init__(self, where: str, found: str, allowed: str) -> None:
        super().__init__(f"{where}: {found}; {allowed}")
        self.where, self.found, self.allowed = where, found, allowed


def refuse_doctype(text: str | bytes, where: str) -> None:
    """Raises XmlError where a document has a DOCTYPE; nothing of it is read, no entity expanded.

    Args:
        text: the document; whether the rest of it is well-formed does not matter.
        where: file or parameter the text comes from, for the message.
    """
    _scan(text, where)


def _scan(text: str | bytes, where: str) -> tuple[list[int], Exception | None]:
    """Returns the line where each start tag begins, and what is not well-formed; raises XmlError at a DOCTYPE."""
    parser = expat.ParserCreate()
    lines: list[int] = []

    def refuse(*_: object) -> None:
        raise XmlError(
            f"{where}:{parser.CurrentLineNumber}",
            "got a DOCTYPE",
            "allowed: XML without one, whose entities could fill the memory; remove it",
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
    try:
        parser.Parse(text, True)
    except XmlError:
        raise
    except (expat.ExpatError, LookupError, ValueError) as fault:  # the last two: an encoding that expat does not know
        return lines, fault
    return lines, None


def parse(text: str | bytes, where: str) -> Element:
    """Returns the root element of a document; comments and processing instructions are left out.

    Args:
        text: the document.
        where: file or parameter it comes from, for the message.

    Raises:
        XmlError: it is not well-formed XML, or has a DOCTYPE.
    """
    lines, error = _scan(text, where)
    if error is not None:
        raise _syntax_error(where, getattr(error, "lineno", 1), error) from error
    is_text = isinstance(text, str)
    parser = etree.XMLParser(
        encoding="utf-8" if is_text else None,  # a declared one does not hold for decoded text
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
        huge_tree=not is_text,  # mesh files are larger than libxml2 allows by default
        recover=True,  # from prefixes that are not declared
    )
    try:
        root = etree.fromstring(text.encode() if isinstance(text, str) else text, parser)
    except etree.XMLSyntaxError as fault:
        raise _syntax_error(where, fault.lineno, fault.msg) from fault
    for entry in parser.error_log.filter_from_errors():
        if entry.domain != etree.ErrorDomains.NAMESPACE:  # libxml2's limits of depth and size
            raise _syntax_error(where, entry.line, entry.message)
    try:
        _name_as_written(root)
    except ValueError as wrong:  # a name such as `a::b`
        raise _syntax_error(where, 1, wrong) from wrong
    for element, line in zip(root.iter(), lines, strict=True):
        if line <= _LAST_LINE:
            element.sourceline = line
    return root


def _syntax_error(where: str, line: int | None, fault: object) -> XmlError:
    return XmlError(
        f"{where}:{line or 1}",
        f"not an XML document (not well-formed XML: {fault})",
        "well-formed XML is needed; mend it",
    )


def _name_as_written(root: Element) -> None:
    """Takes the default namespaces out of the names of the elements."""
    for element in root.iter():
        if element.prefix is None and element.tag.startswith("{"):
            element.tag = etree.QName(element).localname
    etree.cleanup_namespaces(root)


def read(path: Path) -> Element:
    """Returns the root element of a file.

    Raises:
        OSError: the file cannot be read.
        XmlError: it is not well-formed XML, or has a DOCTYPE.
    """
    return parse(path.read_bytes(), str(path))


def add_child(parent: Element, tag: str, **attributes: str) -> Element:
    """Appends an element to a parsed document and returns it."""
    return etree.SubElement(parent, tag, attributes)


def to_text(root: Element) -> str:
    """Returns a parsed document as text."""
    text: str = etree.tostring(root, encoding="unicode")
    return text
