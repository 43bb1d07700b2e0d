# SPDX-License-Identifier: BSD-3-Clause
"""Reads files of named poses: single poses, or poses of several end effectors of a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.yaml_entries import Entry, EntryError, read_each_entry
from modular_framework_urdf.rotations import quaternion_from_rpy

POSITION_KEYS = ("x", "y", "z")
RPY_KEYS = ("r", "p", "y")
QUATERNION_KEYS = ("x", "y", "z", "w")


@dataclass(frozen=True, slots=True)
class Placement:
    """A pose.

    Attributes:
        position_m: Position x, y, z [m].
        quaternion_xyzw: Unit quaternion.
    """

    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NamedPose:
    """A named pose or robot pose.

    Attributes:
        name: Name of the pose.
        reference_frame: Reference frame of the pose.
        placements: Pose of each end-effector link, by link name; a single pose has the key "".
    """

    name: str
    reference_frame: str
    placements: dict[str, Placement]

    @property
    def is_robot_pose(self) -> bool:
        """Whether the entry gives poses of end-effector links."""
        return "" not in self.placements


def parse_placement(entry: Entry) -> Placement:
    """Returns the pose in ``position: {x, y, z}`` and ``orientation: {r, p, y}`` or ``{x, y, z, w}`` of an entry.

    Raises:
        EntryError: A key is missing, a value is not a number, or the norm of the quaternion is 0.
    """
    fields = {child.key: child for child in entry.children()}
    missing = [key for key in ("position", "orientation") if key not in fields]
    if missing:
        raise entry.fault(f"the keys {missing} are missing; a pose needs position and orientation")
    return Placement(read_numbers(fields["position"], POSITION_KEYS), _orientation(fields["orientation"]))


def _orientation(entry: Entry) -> tuple[float, ...]:
    if {child.key for child in entry.children()} != set(QUATERNION_KEYS):
        roll, pitch, yaw = read_numbers(entry, RPY_KEYS)
        return quaternion_from_rpy(roll, pitch, yaw)
    values = read_numbers(entry, QUATERNION_KEYS)
    norm = math.sqrt(sum(value * value for value in values))
    if norm < 1e-6:
        raise entry.fault("the norm of the quaternion is 0; give a unit quaternion")
    return tuple(value / norm for value in values)


def read_numbers(entry: Entry, keys: tuple[str, ...]) -> tuple[float, ...]:
    """Returns the numbers of a mapping with exactly the given keys.

    Raises:
        EntryError: The keys differ, or a value is not a number.
    """
    fields = {child.key: child for child in entry.children()}
    if set(fields) != set(keys):
        raise entry.fault(f"got the keys {sorted(fields)}, expected {list(keys)}")
    return tuple(fields[key].number() for key in keys)


def frame_name(entry: Entry) -> str:
    """Returns a frame name without leading slashes.

    Raises:
        EntryError: The name is empty.
    """
    name = entry.text().lstrip("/")
    if not name:
        raise entry.fault("got an empty text, expected the name of a frame")
    return name


def parse_pose(entry: Entry) -> NamedPose:
    """Returns the pose of an entry.

    Args:
        entry: Mapping with ``reference_frame``, and either ``position`` and ``orientation`` or one such pair for each
            end-effector link.

    Raises:
        EntryError: A key is missing or a value is invalid.
    """
    fields = {child.key: child for child in entry.children()}
    if "reference_frame" not in fields:
        raise entry.fault("the key 'reference_frame' is missing; name the reference frame of the pose")
    frame = frame_name(fields.pop("reference_frame"))
    if "position" in fields or "orientation" in fields:
        unknown = sorted(set(fields) - {"position", "orientation"})
        if unknown:
            raise entry.fault(f"unknown keys {unknown}; allowed: reference_frame, position and orientation")
        return NamedPose(entry.key, frame, {"": parse_placement(entry)})
    if not fields:
        raise entry.fault("contains no pose; give position and orientation, once or for each end-effector link")
    return NamedPose(entry.key, frame, {link: parse_placement(field) for link, field in fields.items()})


def load_poses(path: Path) -> tuple[list[NamedPose], list[EntryError]]:
    """Reads a file of poses.

    Args:
        path: YAML file, name to pose.

    Returns:
        The valid poses in file order, and one error per invalid entry or for an unreadable file.
    """
    return read_each_entry(path, parse_pose)
