# SPDX-License-Identifier: BSD-3-Clause
"""Reads files of named joint states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.yaml_entries import Entry, EntryError, read_each_entry
from modular_framework_core.managers.joint_bounds import Bounds, bounds_fault


@dataclass(frozen=True, slots=True)
class NamedJointState:
    """A named joint state.

    Attributes:
        name: Name of the state.
        joint_names: Joint names in file order.
        positions: Joint positions [rad or m].
    """

    name: str
    joint_names: tuple[str, ...]
    positions: tuple[float, ...]


def parse_joint_state(entry: Entry, bounds: Mapping[str, Bounds]) -> NamedJointState:
    """Returns the joint state of an entry.

    Args:
        entry: Mapping of joint names to positions [rad or m].
        bounds: (lower, upper) [rad or m] of each joint; empty to disable the check.

    Raises:
        EntryError: The entry is not a nonempty mapping of joints to numbers, a joint is unknown, or a position is
            outside of the joint's limits.
    """
    joints = entry.children()
    if not joints:
        raise entry.fault("contains no joint; write one 'joint: position' line for each joint")
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
        bounds: (lower, upper) [rad or m] of each joint; None or empty to disable the check.

    Returns:
        The valid states in file order, and one error per invalid entry or for an unreadable file.
    """
    return read_each_entry(path, lambda entry: parse_joint_state(entry, bounds or {}))
