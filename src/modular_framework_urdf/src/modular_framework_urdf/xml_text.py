# SPDX-License-Identifier: BSD-3-Clause
"""Parses the XML of descriptions, and refuses every document type: its entities may grow without bound."""
from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from xml.parsers import expat


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
        raise XmlError(f"{where}:{parser.CurrentLineNumber}", "got a DOCTYPE",
                       "allowed: XML without one, whose entities could fill the memory; remove it")

    def end(*_: object) -> None:
        raise _HeadIsReadError

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = end
    try:
        parser.Parse(text, True)
    except (_HeadIsReadError, expat.ExpatError):
        return


def parse(text: str | bytes, where: str) -> ElementTree.Element:
    """Returns the root element of a document.

    Args:
        text: the document.
        where: file or parameter it comes from, for the message.

    Raises:
        XmlError: it is not well-formed XML, or has a DOCTYPE.
    """
    refuse_doctype(text, where)
    try:
        root: ElementTree.Element = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise XmlError(f"{where}:{error.position[0]}", f"not an XML document ({error})",
                       "well-formed XML is needed; mend it") from error
    return root


def read(path: Path) -> ElementTree.Element:
    """Returns the root element of a file.

    Raises:
        OSError: the file cannot be read.
        XmlError: it is not well-formed XML, or has a DOCTYPE.
    """
    return parse(path.read_bytes(), str(path))
