# SPDX-License-Identifier: BSD-3-Clause
"""What an experiment file can refer to on this machine: launch files, tasks, models, packages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol


class NotThere(Exception):
    """Something that is referred to is not there, or cannot be used; the message says what is allowed."""


class Surroundings(Protocol):
    """Answers what there is. `RosSurroundings` looks it up in the ROS packages."""

    def launch_file(self, name: str) -> Path:
        """Returns the path of a launch file.

        Args:
            name: PACKAGE/FILE with a file in the package's folder launch, or a path from /.

        Raises:
            NotThere: There is no such package or file.
        """

    def launch_arguments(self, launch: str) -> Mapping[str, str | None]:
        """Returns the arguments a launch file takes, with their defaults.

        Raises:
            NotThere: As `launch_file`; or the file is no launch file.
        """

    def launch_faults(self, launch: str, arguments: Mapping[str, str]) -> Sequence[str]:
        """Returns what is wrong with the values of arguments of a launch file, all of which it takes.

        Each is a sentence that names the argument.

        Raises:
            NotThere: There is no such launch file.
        """

    def task(self, name: str, folder: Path) -> str:
        """Returns the path of a task.

        Args:
            name: A task of the API package, or a path.
            folder: Where a relative path counts from.

        Raises:
            NotThere: There is no such task.
        """

    def model(self, name: str, launch: str, arguments: Mapping[str, str], folder: Path) -> Path:
        """Returns the file of a model.

        Args:
            name: A model of the description package, or the path of an .sdf file.
            launch: Launch file, whose argument `description_package` names that package.
            arguments: Arguments that are given to it.
            folder: Where a relative path counts from.

        Raises:
            NotThere: There is no such model.
        """

    def package(self, name: str) -> Path:
        """Returns the folder of a ROS package.

        Raises:
            NotThere: There is no such package.
        """
