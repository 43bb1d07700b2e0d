# SPDX-License-Identifier: BSD-3-Clause
"""Where a launch description comes from."""

from __future__ import annotations

from launch.actions.launch_description import LaunchDescription
from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions
from launch.substitutions.text import described


class LaunchDescriptionSource:
    """Base of sources.

    Args:
        launch_description: The description, or None when it is read from a file.
        location: Path of the file.
    """

    def __init__(
        self, launch_description: LaunchDescription | None = None, location: SomeSubstitutionsType = "<script>"
    ) -> None:
        self._description = launch_description
        self._location = normalize_to_list_of_substitutions(location)
        self._path: str | None = None
        self._loaded: LaunchDescription | None = None

    @property
    def location(self) -> str:
        """Path of the file; before it is known, how it is written."""
        return self._path if self._path is not None else described(self._location)

    def get_launch_description(self, context: LaunchContext) -> LaunchDescription:
        """Returns the description; a file is read once.

        Raises:
            LaunchError: The file cannot be read.
        """
        if self._description is not None:
            return self._description
        path = perform_substitutions(context, self._location)
        if self._loaded is None or path != self._path:
            self._path, self._loaded = path, self.load(path)
        return self._loaded

    def try_get_launch_description_without_context(self) -> LaunchDescription | None:
        """Returns the description if its path is known before the launch, and None if it is not."""
        if self._description is not None:
            return self._description
        try:
            return self.get_launch_description(LaunchContext())
        except LaunchError:
            return None

    def load(self, path: str) -> LaunchDescription:
        """Reads the description from a file."""
        raise NotImplementedError(f"{type(self).__name__} reads no files")
