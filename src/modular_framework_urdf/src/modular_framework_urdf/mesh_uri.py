# SPDX-License-Identifier: BSD-3-Clause
"""Finds the file that the URI of a mesh names."""
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


class MeshUriError(ValueError):
    """A URI names no file; `found` says what is wrong, `allowed` what to do about it."""

    def __init__(self, found: str, allowed: str) -> None:
        super().__init__(f"{found}; {allowed}")
        self.found, self.allowed = found, allowed


def mesh_path(uri: str, find_package: Callable[[str], str]) -> Path:
    """Returns the file of a mesh.

    Args:
        uri: package://, file:// or an absolute path.
        find_package: returns the folder of a ROS package; raises anything when it is not there.

    Raises:
        MeshUriError: the URI has another scheme, or leads nowhere.
    """
    scheme, separator, rest = uri.partition("://")
    if separator and scheme == "package":
        package, _, relative = rest.partition("/")
        try:
            path = Path(find_package(package)) / relative
        except Exception as error:  # the finder is the caller's: whatever it raises means "not there"
            raise MeshUriError(f"package '{package}' is not found ({error})", "install it") from error
    elif separator and scheme == "file":
        path = Path(rest)
    elif separator:
        raise MeshUriError(f"got '{uri}'", "allowed: package://, file:// or an absolute path")
    else:
        path = Path(uri)
    if not path.is_file():
        raise MeshUriError(f"'{path}' does not exist", "check the name, and that its package is installed")
    return path
