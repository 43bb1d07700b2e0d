# SPDX-License-Identifier: BSD-3-Clause
"""Checks the joint names in named joint states and the state names in named trajectories."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from modular_framework_core.task_constructor.known_names import JOINT_STATES_FILE, TRAJECTORIES_FILE, mapping_in_file
from modular_framework_ros.allowed_names import closest, listing, nearest


def named_joint_faults(folder: Path, joints: Collection[str]) -> Iterator[str]:
    """Yields a sentence for each unknown joint of a named state and each unknown state of a trajectory.

    A state without any joint similar to the robot's joints is ignored, because it belongs to a different robot.

    Args:
        folder: Configuration folder.
        joints: Joint names of the robot.

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
    waypoints = points if isinstance(points, list) else []
    return [str(point["name"]) for point in waypoints if isinstance(point, Mapping) and "name" in point]
