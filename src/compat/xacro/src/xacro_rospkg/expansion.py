# SPDX-License-Identifier: BSD-3-Clause
"""Expansion of xacro files whose ``$(find pkg)`` must be answered by rospkg."""

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import rospkg
import xacro
from xacro import substitution_args

_IN_ORDER_FLAGS = ("--inorder", "-i")


class PackageNotFoundError(substitution_args.SubstitutionException):
    """``$(find pkg)`` names a package that is not on ROS_PACKAGE_PATH.

    Attributes:
        package: the name that was looked for.
        search_path: the folders that were searched, in order.
    """

    def __init__(self, package: str, search_path: Sequence[str]) -> None:
        self.package = package
        self.search_path = tuple(search_path)
        folders = ", ".join(self.search_path) or "(ROS_PACKAGE_PATH is empty)"
        super().__init__(
            f"$(find {package}): no ROS package '{package}' under {folders}. "
            "Check the spelling, or source the setup.bash of the workspace that has the package."
        )


def find_package(package: str) -> str:
    """Return the folder of a ROS package.

    Args:
        package: name as written in its package.xml.

    Raises:
        PackageNotFoundError: when the package is not on ROS_PACKAGE_PATH.
    """
    try:
        return str(rospkg.RosPack().get_path(package))
    except rospkg.ResourceNotFound as error:
        search_path = [path for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
        raise PackageNotFoundError(package, search_path) from error


def use_rospkg() -> None:
    """Make the xacro module answer ``$(find pkg)`` and ``$(eval find(...))`` through rospkg."""
    for attribute in ("_eval_find", "_eval_dict"):
        if not hasattr(substitution_args, attribute):
            raise RuntimeError(
                f"xacro.substitution_args has no '{attribute}': this version of the PyPI package xacro is not "
                "supported. Install the version pinned in requirements.txt."
            )
    substitution_args._eval_find = find_package
    substitution_args._eval_dict["find"] = find_package


def expand(path: str | Path, mappings: Mapping[str, str] | None = None) -> str:
    """Return the XML a xacro file expands to.

    Args:
        path: the xacro file.
        mappings: values of its ``xacro:arg``s, as on the command line ``name:=value``.

    Raises:
        PackageNotFoundError: when a ``$(find pkg)`` cannot be answered.
        xacro.XacroException: when the file is not valid xacro.
    """
    use_rospkg()
    document = xacro.process_file(str(path), mappings={key: str(value) for key, value in (mappings or {}).items()})
    return str(document.toprettyxml(indent="  "))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the ``xacro`` command line; ``--inorder`` is accepted and, being the only order there is, ignored."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    use_rospkg()
    sys.argv = [sys.argv[0], *(argument for argument in given if argument not in _IN_ORDER_FLAGS)]
    xacro.main()
