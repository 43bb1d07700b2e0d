# SPDX-License-Identifier: BSD-3-Clause
"""Finds ROS packages and their executables."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import roslib.packages
import rospkg

from launch.core.errors import LaunchError, PackageNotFoundError, hint, listed


@functools.lru_cache(maxsize=4)
def _finder(search_path: str) -> rospkg.RosPack:
    """Returns the package finder for a value of ROS_PACKAGE_PATH; cached, because the finder crawls all folders."""
    del search_path
    return rospkg.RosPack()


def _current_finder() -> rospkg.RosPack:
    return _finder(os.environ.get("ROS_PACKAGE_PATH", ""))


def package_share_directory(package: str) -> str:
    """Returns the share folder of a package.

    Raises:
        PackageNotFoundError: The package does not exist.
    """
    finder = _current_finder()
    try:
        return str(finder.get_path(package))
    except rospkg.ResourceNotFound:
        raise PackageNotFoundError(
            f"there is no package '{package}'{hint(package, finder.list())}; ROS_PACKAGE_PATH has "
            f"{len(finder.list())} packages; install it, or build and source the workspace that contains it"
        ) from None


def program_of_package(package: str, program: str) -> str:
    """Returns the path of a package's executable, as found by rosrun.

    Raises:
        PackageNotFoundError: The package does not exist.
        LaunchError: The package does not have the executable.
    """
    package_share_directory(package)
    paths = roslib.packages.find_node(package, program, rospack=_current_finder())
    if paths:
        return str(paths[0])
    names = programs_of_package(package)
    raise LaunchError(
        f"package '{package}' has no executable '{program}'{hint(program, names)}; known: {listed(names)}; correct "
        "the name, or build the workspace and make the file executable (chmod +x)"
    )


def programs_of_package(package: str) -> set[str]:
    """Returns the names of a package's executable files."""
    share = Path(package_share_directory(package))
    prefixes = [Path(each) for each in os.environ.get("CMAKE_PREFIX_PATH", "").split(":") if each]
    folders = [share, *(prefix / "lib" / package for prefix in [share.parent.parent, *prefixes])]
    names = set()
    for folder in folders:
        files = folder.rglob("*") if folder.is_dir() else ()
        names |= {path.name for path in files if path.is_file() and os.access(path, os.X_OK)}
    return names


def plugin_descriptions(package: str) -> list[Path]:
    """Returns the plugin description files that all ROS packages, including the package itself, export to a package.

    Raises:
        PackageNotFoundError: The package does not exist.
    """
    package_share_directory(package)
    finder = _current_finder()
    return [
        Path(description.replace("${prefix}", finder.get_path(each)))
        for each in (package, *finder.get_depends_on(package, implicit=False))
        for description in finder.get_manifest(each).get_export(package, "plugin")
    ]
