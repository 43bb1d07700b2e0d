# SPDX-License-Identifier: BSD-3-Clause
"""Folders of ROS packages."""

from __future__ import annotations

from pathlib import Path

import rospkg
from launch.core.errors import PackageNotFoundError
from launch.ros_packages import package_share_directory

__all__ = [
    "PackageNotFoundError",
    "get_package_prefix",
    "get_package_share_directory",
    "get_package_share_path",
    "get_packages_with_prefixes",
]


def get_package_share_directory(package_name: str, print_warning: bool = True) -> str:
    """Returns the folder of a package's files.

    Args:
        package_name: Name of the package.
        print_warning: Accepted and ignored.

    Raises:
        PackageNotFoundError: There is no such package.
    """
    del print_warning
    return package_share_directory(package_name)


def get_package_share_path(package_name: str, print_warning: bool = True) -> Path:
    """Returns the folder of a package's files as a Path; see get_package_share_directory."""
    return Path(get_package_share_directory(package_name, print_warning))


def get_package_prefix(package_name: str) -> str:
    """Returns the install prefix of a package; without an install space, the folder of the package."""
    share = get_package_share_path(package_name)
    return str(share.parent.parent if share.parent.name == "share" else share)


def get_packages_with_prefixes() -> dict[str, str]:
    """Returns the folders of all packages, by name."""
    finder = rospkg.RosPack()
    return {name: get_package_prefix(name) for name in finder.list()}
