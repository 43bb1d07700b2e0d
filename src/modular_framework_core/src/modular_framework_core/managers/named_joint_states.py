# SPDX-License-Identifier: BSD-3-Clause
"""Reads joint states a user has given names to, and keeps the good ones when some are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.yaml_entries import Entry, EntryError, read_each_entry
from modular_framework_core.managers.joint_bounds import Bounds, bounds_fault


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


def parse_joint_state(entry: Entry, bounds: Mapping[str, Bounds]) -> NamedJointState:
    """Turns one entry of the file into a joint state.

    Args:
        entry: Mapping of joint names to positions [rad or m].
        bounds: (lower, upper) of each joint of the robot; empty when they are not known.

    Returns:
        The joint state.

    Raises:
        EntryError: The entry is empty, no mapping, or a position is no number; or the robot has no such joint, or its
            joint cannot go there.
    """
    joints = entry.children()
    if not joints:
        raise entry.fault("holds no joint; write one 'joint: position' line for each joint")
    positions = tuple(joint.number() for joint in joints)
    for joint, position in zip(joints, positions, strict=True):
        fault = bounds_fault(joint.key, position, bounds)
        if fault:
            raise joint.fault(fault)
    return NamedJointState(entry.key, tuple(joint.key for joint in joints), positions)


def load_joint_states(
    path: Path, bounds: Mapping[str, Bounds] | None = None
) -> tuple[list[NamedJointState], list[EntryError]]:
    """Reads a file of joint states.

    Args:
        path: YAML file, name to {joint: position [rad or m]}.
        bounds: (lower, upper) of each joint of the robot, for a check against them; none leaves it out.

    Returns:
        The usable states in file order, and one error for each entry (or for the file) that is not usable.
    """
    states: list[NamedJointState] = []
    faults = read_each_entry(path, lambda entry: states.append(parse_joint_state(entry, bounds or {})))
    return states, faults
