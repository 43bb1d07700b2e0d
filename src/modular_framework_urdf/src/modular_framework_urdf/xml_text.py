# SPDX-License-Identifier: BSD-3-Clause
"""Parses the XML of descriptions so that each element knows its line, and refuses every document type.

The entities of a document type may grow without bound. Elements of a default namespace (`<robot xmlns="...">`) are
called as they are written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.parsers import expat

from lxml import etree

Element = Any
"""An lxml element; `sourceline` is its line, from 1."""


class XmlError(ValueError):
    """A text is no XML this project reads.

    Args:
        where: the text and its line; found: what is wrong there; allowed: what would do, and what to do about it.
    """

    def __init__(self, where: str, found: str, allowed: str) -> None:
        super().__init__(f"{where}: {found}; {allowed}")
        self.where, self.found, self.allowed = where, found, allowed


class _HeadIsReadError(Exception):
    """The root element begins: no document type can follow."""


def refuse_doctype(text: str | bytes, where: str) -> None:
    """Raises XmlError where a document has a DOCTYPE; nothing of it is read, no entity expanded.

    Args:
        text: the document; whether the rest of it is well-formed does not matter.
        where: file or parameter the text comes from, for the message.
    """
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise XmlError(
            f"{where}:{parser.CurrentLineNumber}",
            "got a DOCTYPE",
            "allowed: XML without one, whose entities could fill the memory; remove it",
        )

    def end(*_: object) -> None:
        raise _HeadIsReadError

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = end
    try:
        parser.Parse(text, True)
    except (_HeadIsReadError, expat.ExpatError):
        return


def parse(text: str | bytes, where: str) -> Element:
    """Returns the root element of a document; comments and processing instructions are left out.

    Args:
        text: the document.
        where: file or parameter it comes from, for the message.

    Raises:
        XmlError: it is not well-formed XML, or has a DOCTYPE.
    """
    refuse_doctype(text, where)
    is_text = isinstance(text, str)
    parser = etree.XMLParser(
        encoding="utf-8" if is_text else None,  # a declared one does not hold for decoded text
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
        huge_tree=not is_text,
    )  # mesh files are larger than libxml2 allows by default
    try:
        root = etree.fromstring(text.encode() if isinstance(text, str) else text, parser)
    except (etree.XMLSyntaxError, UnicodeEncodeError) as error:
        line, fault = getattr(error, "lineno", None) or 1, getattr(error, "msg", error)
        raise XmlError(
            f"{where}:{line}",
            f"not an XML document (not well-formed XML: {fault})",
            "well-formed XML is needed; mend it",
        ) from error
    if None in root.nsmap:
        for element in root.iter():
            if element.prefix is None:
                element.tag = etree.QName(element).localname
        etree.cleanup_namespaces(root)
    return root


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
