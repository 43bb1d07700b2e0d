# SPDX-License-Identifier: BSD-3-Clause
"""Checks that the launch files of a config package refer to existing files."""

from __future__ import annotations

import re
from pathlib import Path

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_ros.allowed_names import nearest
from modular_framework_setup.config_files.config_package import ConfigPackage
from modular_framework_setup.config_files.description_files import add_xml_error
from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import XmlError

INPUTS = (".yaml", ".yml", ".rviz", ".launch", ".xml", ".srdf", ".urdf", ".xacro")
_OWN_FILE = re.compile(r"^\$\((?P<base>find [\w-]+|dirname)\)(?P<path>/[^$\s]+)$")


def check_launch_files(package: ConfigPackage, faults: FaultList) -> None:
    """Reports launch files that are not XML, and references to missing files of the package.

    Paths with arguments and files of other packages are not checked.
    """
    for path in package.launch_files():
        try:
            root = xml_text.read(path)
        except XmlError as error:
            add_xml_error(error, faults)
            continue
        for element in root.iter():
            for key, value in element.attrib.items():
                file = _named_file(value, path, package) if _names_input(key, value) else None
                if file is not None and not file.exists():
                    names = sorted(item.name for item in file.parent.glob("*")) if file.parent.is_dir() else []
                    faults.add(
                        SourceLocation(str(path), element.sourceline, 1),
                        f"<{element.tag}> names {value}, but there is no such file{nearest(file.name, names)}; "
                        "correct the name, or add the file",
                    )


def _names_input(key: str, value: str) -> bool:
    """Returns whether an attribute names an input file; arguments may also name output files and folders."""
    return key in ("file", "textfile") or (key in ("default", "value") and value.endswith(INPUTS))


def _named_file(value: str, launch_file: Path, package: ConfigPackage) -> Path | None:
    match = _OWN_FILE.match(value)
    if match is None:
        return None
    if match["base"] == "dirname":
        return launch_file.parent / match["path"].lstrip("/")
    return package.folder / match["path"].lstrip("/") if match["base"] == f"find {package.name}" else None
