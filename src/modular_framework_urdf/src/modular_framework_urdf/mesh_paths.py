# SPDX-License-Identifier: BSD-3-Clause
"""Resolves mesh URIs: package://, file:// or a path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from modular_framework_urdf.mesh_reader import MeshError

PackageFinder = Callable[[str], str]
"""Function that returns the folder of a ROS package, or raises an exception if the package is not found."""


def mesh_path(uri: str, find_package: PackageFinder) -> Path:
    """Returns the path of a mesh file.

    Args:
        uri: Mesh URI: package://, file:// or an absolute path.
        find_package: Function that returns the folder of a ROS package.

    Raises:
        MeshError: The scheme is unknown, or the file does not exist.
    """
    scheme, separator, location = uri.partition("://")
    if separator and scheme == "package":
        package, _, relative = location.partition("/")
        try:
            path = Path(find_package(package)) / relative
        except Exception as error:  # the caller's function may raise any exception for a missing package
            raise MeshError(uri, f"package '{package}' is not found ({error})", "install it") from error
    elif separator and scheme == "file":
        path = Path(location)
    elif separator:
        raise MeshError(uri, f"got '{uri}'", "allowed: package://, file:// or an absolute path")
    else:
        path = Path(uri)
    if not path.is_file():
        raise MeshError(uri, f"'{path}' does not exist", "check the name and the installation of its package")
    return path
