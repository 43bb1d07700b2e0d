# SPDX-License-Identifier: BSD-3-Clause
"""Base class of sources of launch descriptions."""

from __future__ import annotations

from launch.actions.launch_description import LaunchDescription
from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions
from launch.substitutions.text import described


class LaunchDescriptionSource:
    """Source of a launch description.

    Args:
        launch_description: The description; None for a description that is read from a file.
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
        """Returns the path of the file; before it is known, a description of its substitutions."""
        return self._path if self._path is not None else described(self._location)

    def get_launch_description(self, context: LaunchContext) -> LaunchDescription:
        """Returns the description; a file is read only once.

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
        """Returns the description if its path is known before the launch, otherwise None."""
        if self._description is not None:
            return self._description
        try:
            return self.get_launch_description(LaunchContext())
        except LaunchError:
            return None

    def load(self, path: str) -> LaunchDescription:
        """Reads the description from a file."""
        raise NotImplementedError(f"{type(self).__name__} does not read files")
