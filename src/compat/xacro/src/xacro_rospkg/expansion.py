# SPDX-License-Identifier: BSD-3-Clause
"""Expansion of xacro files whose ``$(find pkg)`` must be answered by rospkg."""

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
        package: the name that was looked for.
        similar: names of packages that exist and look like it.
    """

    def __init__(self, package: str, similar: Sequence[str]) -> None:
        self.package = package
        self.similar = tuple(similar)
        hint = f"did you mean {' or '.join(self.similar)}?" if similar else "nothing there has a similar name."
        super().__init__(
            f"$(find {package}): no ROS package '{package}' on ROS_PACKAGE_PATH; {hint} "
            "If the name is right, source the setup.bash of the workspace that has the package."
        )


def find_package(package: str) -> str:
    """Returns the folder of a ROS package.

    Args:
        package: name as written in its package.xml.

    Raises:
        PackageNotFoundError: when the package is not on ROS_PACKAGE_PATH.
    """
    packages = rospkg.RosPack()
    try:
        return str(packages.get_path(package))
    except rospkg.ResourceNotFound as error:
        raise PackageNotFoundError(package, difflib.get_close_matches(package, packages.list())) from error


def parse_without_doctype(inp: Any, filename: str | None = None) -> Any:
    """Parses a text or file as ``xacro.parse`` does; a DOCTYPE is refused before any entity is expanded.

    Raises:
        xacro.XacroException: when there is a DOCTYPE.
    """
    source = Path(xacro.root_dir, filename or "text")
    text = inp if isinstance(inp, str) else source.read_bytes() if inp is None and source.is_file() else ""
    try:
        refuse_doctype(text, str(source))
    except XmlError as error:
        raise xacro.XacroException(str(error)) from error
    return _parse(inp, filename)


def adapt_xacro() -> None:
    """Makes the xacro module resolve ``$(find pkg)`` through rospkg, and refuse a DOCTYPE in every file it reads."""
    if not hasattr(substitution_args, "_eval_find"):
        raise RuntimeError(
            "xacro.substitution_args has no '_eval_find': this version of the PyPI package xacro is not supported. "
            "Install the version pinned in requirements.txt."
        )
    substitution_args._eval_find = find_package
    xacro.parse = parse_without_doctype


def expand(path: str | Path, mappings: Mapping[str, str] | None = None) -> str:
    """Returns the XML a xacro file expands to.

    Args:
        path: the xacro file.
        mappings: values of its ``xacro:arg``s, as on the command line ``name:=value``.

    Raises:
        PackageNotFoundError: when a ``$(find pkg)`` cannot be answered.
        xacro.XacroException: when the file is not valid xacro.
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
    """Runs the ``xacro`` command line; ``--inorder`` is accepted and, being the only order there is, ignored."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    adapt_xacro()
    sys.argv = [sys.argv[0], *(argument for argument in given if argument not in _IN_ORDER_FLAGS)]
    xacro.main()
