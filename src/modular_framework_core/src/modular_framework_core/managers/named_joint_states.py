# SPDX-License-Identifier: BSD-3-Clause
"""Reads joint states a user has given names to, and keeps the good ones when some are wrong."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.managers.yaml_entries import Entry, EntryError, take_entries


@dataclass(frozen=True, slots=True)
class NamedJointState:
    """Positions of some joints under a name.

    Attributes:
        name: Name of the state.
        joint_names: Joints in file order.
        positions: One position a joint [rad or m].
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]


def parse_joint_state(entry: Entry) -> NamedJointState:
    """Turns one entry of the file into a joint state.

    Args:
        entry: Mapping of joint names to positions [rad or m].

    Returns:
        The joint state.

    Raises:
        EntryError: The entry is empty, no mapping, or a position is no number.
    """
    joints = entry.children()
    if not joints:
        raise entry.fault("holds no joint; write one 'joint: position' line for each joint")
    return NamedJointState(entry.key, tuple(j.key for j in joints), tuple(j.number() for j in joints))


def load_joint_states(path: Path) -> tuple[list[NamedJointState], list[EntryError]]:
    """Reads a file of joint states.

    Args:
        path: YAML file, name to {joint: position [rad or m]}.

    Returns:
        The usable states in file order, and one error for each entry (or for the file) that is not usable.
    """
    states: list[NamedJointState] = []
    faults = take_entries(path, lambda entry: states.append(parse_joint_state(entry)))
    return states, faults
