# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions for ROS packages and parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from launch.core.errors import SubstitutionFailure, hint, listed
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions, perform_text
from launch.ros_packages import package_share_directory, program_of_package
from launch.substitutions import PathJoinSubstitution
from launch.substitutions.text import SubstitutionOfText, described

__all__ = ["ExecutableInPackage", "FindPackage", "FindPackagePrefix", "FindPackageShare", "Parameter"]


class FindPackage(SubstitutionOfText):
    """Base class of substitutions by a folder of a ROS package.

    Args:
        package: Name of the package.
    """

    package = SubstitutionOfText.text

    def __init__(self, package: SomeSubstitutionsType) -> None:
        super().__init__(package)

    def find(self, package_name: str) -> str:
        """Returns the folder.

        Raises:
            PackageNotFoundError: The package does not exist.
        """
        raise NotImplementedError(f"{type(self).__name__} has no folder; define find(package_name)")

    def _value(self, context: LaunchContext, package: str) -> str:
        return self.find(package)

    def __truediv__(self, part: SomeSubstitutionsType) -> PathJoinSubstitution:
        """Returns a path in the folder, as in `FindPackageShare("robot") / "config"`."""
        return PathJoinSubstitution([self, normalize_to_list_of_substitutions(part)])


class FindPackageShare(FindPackage):
    """Share folder of a package."""

    def find(self, package_name: str) -> str:
        return package_share_directory(package_name)


class FindPackagePrefix(FindPackage):
    """Installation prefix of a package; in a workspace without installation, the share folder."""

    def find(self, package_name: str) -> str:
        share = Path(package_share_directory(package_name))
        return str(share.parent.parent if share.parent.name == "share" else share)


class ExecutableInPackage(FindPackage):
    """Path of a package's program.

    Args:
        executable: Name of the program.
        package: Name of the package.
    """

    def __init__(self, executable: SomeSubstitutionsType, package: SomeSubstitutionsType) -> None:
        super().__init__(package)
        self._executable = normalize_to_list_of_substitutions(executable)

    def describe(self) -> str:
        return f"ExecInPkg({described(self._text)}, {described(self._executable)})"

    def _value(self, context: LaunchContext, package: str) -> str:
        return program_of_package(package, perform_substitutions(context, self._executable))


class Parameter(SubstitutionOfText):
    """Value of a parameter set by SetParameter.

    Args:
        name: Name of the parameter.
        default: Value of a parameter that is not set.
    """

    def __init__(self, name: SomeSubstitutionsType, *, default: Any = None) -> None:
        super().__init__(name)
        self._default = default

    def _value(self, context: LaunchContext, name: str) -> str:
        known: dict[str, Any] = {}
        for entry in context.launch_configurations.get("global_params", ()):
            known |= entry if isinstance(entry, dict) else {}
        if name in known:
            return str(known[name])
        if self._default is None:
            raise SubstitutionFailure(
                f"no SetParameter has set '{name}'{hint(name, known)}; set: {listed(known)}; set it before, "
                "or give Parameter a default"
            )
        is_text = isinstance(self._default, str | Substitution | list | tuple)
        return perform_text(context, self._default if is_text else str(self._default))
