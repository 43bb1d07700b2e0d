# SPDX-License-Identifier: BSD-3-Clause
"""Finds a world file by the name that a launch file gives it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError

RESOURCE_PATH = "GAZEBO_RESOURCE_PATH"


def find_world_file(name: str, environment: Mapping[str, str], own_folders: Sequence[Path]) -> Path:
    """Returns the file: a path, or a path below a folder of GAZEBO_RESOURCE_PATH, or below one of our own.

    Args:
        name: As given, for example "worlds/empty.world".
        environment: Variables of the environment.
        own_folders: Where worlds that come with this package lie.

    Raises:
        DescriptionError: There is none.
    """
    folders = [Path(each) for each in environment.get(RESOURCE_PATH, "").split(os.pathsep) if each]
    candidates = [Path(name), *(folder / name for folder in (*folders, *own_folders))]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    looked_for = ", ".join(str(each) for each in candidates)
    advice = f"looked for {looked_for}; set {RESOURCE_PATH}"
    raise DescriptionError(name, "cannot be read: there is no such file", advice)
