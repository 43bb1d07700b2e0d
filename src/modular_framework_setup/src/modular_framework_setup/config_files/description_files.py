# SPDX-License-Identifier: BSD-3-Clause
"""Reads the URDF and the SRDF of a config package, expands xacro and reports faults with file and line."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from xacro_rospkg import PackageNotFoundError, expand

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_setup.config_files.config_package import ConfigPackage
from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import XmlError

_XACRO_NAMESPACE = "www.ros.org/wiki/xacro"
_AT_LINE = re.compile(r"^(?P<file>.*):(?P<line>\d+)$")
_NAMES = re.compile(r"'([^']+)'|\(find (\w+)\)|\"([^\"]+)\"|: (\S+)$")


@dataclass(frozen=True, slots=True)
class XmlDocument:
    """The text of a URDF or SRDF.

    Attributes:
        text: Text with xacro expanded.
        where: Name of the document in messages, before the line number.
    """

    text: str
    where: str


def read_document(path: Path, arguments: Mapping[str, str], faults: FaultList) -> XmlDocument | None:
    """Reads a URDF or SRDF.

    Args:
        path: XML or xacro file.
        arguments: Arguments of the xacro file.
        faults: Receives a fault if the file cannot be read or expanded.

    Returns:
        The document, or None. Line numbers of a xacro file refer to the expanded text.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        faults.add(SourceLocation(str(path), 1, 1), f"cannot be read ({error}); make the file readable")
        return None
    if ".xacro" not in path.suffixes and _XACRO_NAMESPACE not in text:
        return XmlDocument(text, str(path))
    xacro_output = io.StringIO()
    try:
        with contextlib.redirect_stderr(xacro_output):
            return XmlDocument(expand(path, arguments), f"{path} (expanded)")
    except Exception as error:  # noqa: BLE001 - xacro evaluates Python expressions, which can raise anything
        file, line = _fault_location(path, str(error), error)
        reason = " ".join(str(error).split()) or type(error).__name__
        faults.add(SourceLocation(str(file), line, 1), f"xacro fails: {reason}; correct the file, or give the argument")
        return None


def package_document(package: ConfigPackage, path: Path | None, faults: FaultList) -> XmlDocument | None:
    """Reads the URDF or SRDF of a config package with the arguments in its launch files and `.setup_assistant`.

    Args:
        package: Config package.
        path: URDF or SRDF; None if not found.
        faults: Receives the faults.
    """
    if path is None:
        return None
    return read_document(path, {**package.launch_mappings(path.name), **package.xacro_arguments}, faults)


def _fault_location(path: Path, reason: str, error: Exception) -> tuple[Path, int]:
    """Returns file and line of a xacro fault: the first line, here or in sibling files, with a name from the reason."""
    line = getattr(getattr(error, "exc", error), "lineno", None)
    if line:
        return path, int(line)
    names = [error.package] if isinstance(error, PackageNotFoundError) else []
    names += [name for match in _NAMES.findall(reason) for name in match if name]
    neighbours = sorted(item for item in path.parent.glob("*.xacro") if item != path)
    for name in names:
        pattern = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
        for file in (path, *neighbours):
            for line_number, text in enumerate(file.read_text(errors="replace").splitlines(), start=1):
                if pattern.search(text):
                    return file, line_number
    return path, 1


def add_xml_error(error: XmlError, faults: FaultList) -> None:
    """Adds a fault for an error of the XML reader."""
    match = _AT_LINE.match(error.location)
    location = SourceLocation(match["file"], int(match["line"]), 1) if match else SourceLocation(error.location, 1, 1)
    faults.add(location, f"{error.found}; {error.allowed}")


def parse_document(document: XmlDocument, faults: FaultList) -> xml_text.Element | None:
    """Returns the root element of a document, or None with a fault if the XML is not well-formed."""
    try:
        return xml_text.parse(document.text, document.where)
    except XmlError as error:
        add_xml_error(error, faults)
        return None
