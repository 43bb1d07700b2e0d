# SPDX-License-Identifier: BSD-3-Clause
"""Lookup of the references in an experiment file: launch files, tasks, models, packages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

DEFAULT_LAUNCH = "modular_framework_api/start_framework.launch"


class UnresolvedReference(Exception):
    """A reference of an experiment file cannot be resolved; the message lists the allowed values."""


class UnreadableWorld(UnresolvedReference):
    """The world of a launch is missing or invalid, and no episode can start; the message names file and line."""


class ResourceLookup(Protocol):
    """Interface of the lookup; `RosResourceLookup` uses the ROS packages."""

    def launch_file(self, name: str) -> Path:
        """Returns the path of a launch file.

        Args:
            name: PACKAGE/FILE with a file in the package's folder launch, or an absolute path.

        Raises:
            UnresolvedReference: The package or file does not exist.
        """

    def launch_arguments(self, launch: str) -> Mapping[str, str | None]:
        """Returns the arguments of a launch file with their defaults.

        Raises:
            UnresolvedReference: The launch file does not exist or is invalid.
        """

    def launch_faults(self, launch: str, arguments: Mapping[str, str]) -> Sequence[str]:
        """Returns the errors in the values of declared launch arguments, each with the name of the argument.

        Raises:
            UnresolvedReference: The launch file does not exist.
        """

    def task(self, name: str, folder: Path) -> str:
        """Returns the path of a task.

        Args:
            name: Name of a task in the API package, or a path.
            folder: Base of relative paths.

        Raises:
            UnresolvedReference: The task does not exist.
        """

    def model(self, name: str, launch: str, arguments: Mapping[str, str], folder: Path) -> Path:
        """Returns the SDF file of a model.

        Args:
            name: Name of a model in the search path of models, or path of an .sdf file.
            launch: Launch file whose argument `description_package` names that package.
            arguments: Arguments of the launch file.
            folder: Base of relative paths.

        Raises:
            UnresolvedReference: The model does not exist.
        """

    def world_models(self, launch: str, arguments: Mapping[str, str]) -> Mapping[str, Sequence[str]]:
        """Returns the movable joints of each model in the world of a launch, keyed by model.

        Args:
            launch: Launch file with the arguments `description_package` and `world_file`.
            arguments: Arguments of the launch file.

        Raises:
            UnreadableWorld: The world does not exist or is invalid.
            UnresolvedReference: The launch file names no world.
        """

    def package(self, name: str) -> Path:
        """Returns the folder of a ROS package.

        Raises:
            UnresolvedReference: The package does not exist.
        """
