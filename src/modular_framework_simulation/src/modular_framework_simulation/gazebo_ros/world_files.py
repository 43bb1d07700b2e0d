# SPDX-License-Identifier: BSD-3-Clause
"""Finds a world file by the name that a launch file gives it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_resources import RESOURCE_PATH


def find_world_file(name: str, folders: Sequence[Path]) -> Path:
    """Returns the file: a path, or a path below one of the folders of resources.

    Args:
        name: As given, for example "worlds/empty.world".
        folders: Those of GAZEBO_RESOURCE_PATH, and that of the worlds which come with this package.

    Raises:
        DescriptionError: There is none.
    """
    candidates = [Path(name), *(folder / name for folder in folders)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    looked_for = ", ".join(str(each) for each in candidates)
    advice = f"looked for {looked_for}; set {RESOURCE_PATH}"
    raise DescriptionError(name, "cannot be read: there is no such file", advice)
