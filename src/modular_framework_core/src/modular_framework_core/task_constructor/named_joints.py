# SPDX-License-Identifier: BSD-3-Clause
"""Checks the names inside the files of named joint states and trajectories."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from modular_framework_core.files.faults import closest, listing, nearest
from modular_framework_core.task_constructor.known_names import JOINT_STATES_FILE, TRAJECTORIES_FILE, mapping_in_file


def named_joint_faults(folder: Path, joints: Collection[str]) -> Iterator[str]:
    """Yields a sentence for each joint that the robot does not have, and each state that a trajectory lacks.

    A state all of whose joints are unlike those of the robot belongs to another robot, and is no fault.

    Args:
        folder: Folder of the configuration files.
        joints: Joints of the robot.

    Raises:
        ValueError: A file cannot be read.
    """
    states = mapping_in_file(folder / JOINT_STATES_FILE)
    for state, positions in (states or {}).items():
        names = list(map(str, positions)) if isinstance(positions, Mapping) else []
        if not any(name in joints or closest(name, joints) for name in names):
            continue
        for name in names:
            if name not in joints:
                hint = f"{listing(joints)}{nearest(name, joints)}"
                yield f"{folder / JOINT_STATES_FILE}: '{state}' names no joint: '{name}'; {hint}"
    if states is None:
        return
    for trajectory, points in (mapping_in_file(folder / TRAJECTORIES_FILE) or {}).items():
        for name in _states_of(points):
            if name not in states:
                hint = f"{listing(map(str, states))}{nearest(name, map(str, states))}"
                yield f"{folder / TRAJECTORIES_FILE}: '{trajectory}' names no joint state: '{name}'; {hint}"


def _states_of(points: Any) -> list[str]:
    found = points if isinstance(points, list) else []
    return [str(point["name"]) for point in found if isinstance(point, Mapping) and "name" in point]
