# SPDX-License-Identifier: BSD-3-Clause
"""Finds the file that a description names as a mesh: package://, file:// or a path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from modular_framework_urdf.mesh_reader import MeshError

PackageFinder = Callable[[str], str]
"""Returns the folder of a ROS package; raises an exception naming the package when it is not there."""


def mesh_path(uri: str, find_package: PackageFinder) -> Path:
    """Returns the file of a mesh.

    Args:
        uri: package://, file:// or an absolute path.
        find_package: looks up the packages of package:// URIs.

    Raises:
        MeshError: the URI has another scheme, or leads nowhere.
    """
    scheme, separator, rest = uri.partition("://")
    if separator and scheme == "package":
        package, _, relative = rest.partition("/")
        try:
            path = Path(find_package(package)) / relative
        except Exception as error:  # the finder is the caller's: whatever it raises means "not there"
            raise MeshError(uri, f"package '{package}' is not found ({error})", "install it") from error
    elif separator and scheme == "file":
        path = Path(rest)
    elif separator:
        raise MeshError(uri, f"got '{uri}'", "allowed: package://, file:// or an absolute path")
    else:
        path = Path(uri)
    if not path.is_file():
        raise MeshError(uri, f"'{path}' does not exist", "check the name, and that its package is installed")
    return path
