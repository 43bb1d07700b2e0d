# SPDX-License-Identifier: BSD-3-Clause
"""Expands xacro files and resolves ``$(find pkg)`` by rospkg."""

import difflib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import rospkg
import xacro
from xacro import substitution_args

from modular_framework_urdf.xml_text import XmlError, refuse_doctype

_IN_ORDER_FLAGS = ("--inorder", "-i")
_parse = xacro.parse


class PackageNotFoundError(substitution_args.SubstitutionException):
    """``$(find pkg)`` names a package that is not on ROS_PACKAGE_PATH.

    Attributes:
        package: Name of the missing package.
        similar: Similar names of existing packages.
    """

    def __init__(self, package: str, similar: Sequence[str]) -> None:
        self.package = package
        self.similar = tuple(similar)
        hint = f"did you mean {' or '.join(self.similar)}?" if similar else "no package has a similar name."
        super().__init__(
            f"$(find {package}): no ROS package '{package}' on ROS_PACKAGE_PATH; {hint} "
            "If the name is right, source the setup.bash of the workspace that has the package."
        )


def find_package(package: str) -> str:
    """Returns the folder of a ROS package.

    Args:
        package: Package name, as in package.xml.

    Raises:
        PackageNotFoundError: The package is not on ROS_PACKAGE_PATH.
    """
    packages = rospkg.RosPack()
    try:
        return str(packages.get_path(package))
    except rospkg.ResourceNotFound as error:
        raise PackageNotFoundError(package, difflib.get_close_matches(package, packages.list())) from error


def parse_without_doctype(inp: Any, filename: str | None = None) -> Any:
    """Parses a text or file as ``xacro.parse`` does, and refuses a DOCTYPE before entities are expanded.

    Raises:
        xacro.XacroException: The document has a DOCTYPE.
    """
    source = Path(xacro.root_dir, filename or "text")
    text = inp if isinstance(inp, str) else source.read_bytes() if inp is None and source.is_file() else ""
    try:
        refuse_doctype(text, str(source))
    except XmlError as error:
        raise xacro.XacroException(str(error)) from error
    return _parse(inp, filename)


def adapt_xacro() -> None:
    """Changes the xacro module so that it resolves ``$(find pkg)`` by rospkg and refuses a DOCTYPE."""
    if not hasattr(substitution_args, "_eval_find"):
        raise RuntimeError(
            "xacro.substitution_args has no '_eval_find': this version of the PyPI package xacro is not supported. "
            "Install the version pinned in requirements.txt."
        )
    substitution_args._eval_find = find_package
    xacro.parse = parse_without_doctype


def expand(path: str | Path, mappings: Mapping[str, str] | None = None) -> str:
    """Returns the XML of an expanded xacro file.

    Args:
        path: Path of the xacro file.
        mappings: Values of the ``xacro:arg`` elements, as in ``name:=value`` on the command line.

    Raises:
        PackageNotFoundError: A package of ``$(find pkg)`` is missing.
        xacro.XacroException: The file is not valid xacro.
    """
    adapt_xacro()
    try:
        document = xacro.process_file(str(path), mappings={key: str(value) for key, value in (mappings or {}).items()})
    except xacro.XacroException as error:
        if isinstance(error.exc, PackageNotFoundError):
            raise error.exc from error
        raise
    return str(document.toprettyxml(indent="  "))


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the ``xacro`` command; ``--inorder`` is accepted and ignored, because there is no other order."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    adapt_xacro()
    sys.argv = [sys.argv[0], *(argument for argument in given if argument not in _IN_ORDER_FLAGS)]
    xacro.main()
