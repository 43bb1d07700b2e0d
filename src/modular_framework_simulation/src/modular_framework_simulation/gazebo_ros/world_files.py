# SPDX-License-Identifier: BSD-3-Clause
"""Finds a world file by its name in a launch file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_resources import RESOURCE_PATH


def find_world_file(name: str, folders: Sequence[Path]) -> Path:
    """Returns the path of a world file, which may be relative to a resource folder.

    Args:
        name: Path in the launch file, for example "worlds/empty.world".
        folders: Folders in GAZEBO_RESOURCE_PATH, and the world folder of this package.

    Raises:
        DescriptionError: The file does not exist.
    """
    candidates = [Path(name), *(folder / name for folder in folders)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    looked_for = ", ".join(str(each) for each in candidates)
    advice = f"looked for {looked_for}; set {RESOURCE_PATH}"
    raise DescriptionError(name, "cannot be read: the file does not exist", advice)
