# SPDX-License-Identifier: BSD-3-Clause
"""Reads poses a user has given names to: of one thing each, or of several end effectors of a robot at once."""

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
        position_m: x, y, z [m].
        quaternion_xyzw: Unit quaternion.
    """

    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NamedPose:
    """One entry of the file.

    Attributes:
        name: Name of the pose.
        reference_frame: Frame it is given in.
        placements: Pose of each end effector's link; the link is "" for a pose of one thing.
    """

    name: str
    reference_frame: str
    placements: dict[str, Placement]

    @property
    def is_robot_pose(self) -> bool:
        """Whether it says where end effectors are, by the names of their links."""
        return "" not in self.placements


def parse_placement(entry: Entry) -> Placement:
    """Reads ``position: {x, y, z}`` and ``orientation: {r, p, y}`` or ``{x, y, z, w}`` of an entry.

    Raises:
        EntryError: A key is missing, or a value is no number, or the quaternion has no length.
    """
    fields = {child.key: child for child in entry.children()}
    missing = [key for key in ("position", "orientation") if key not in fields]
    if missing:
        raise entry.fault(f"the keys {missing} are missing; a pose needs position and orientation")
    return Placement(numbers(fields["position"], POSITION_KEYS), _orientation(fields["orientation"]))


def _orientation(entry: Entry) -> tuple[float, ...]:
    if {child.key for child in entry.children()} != set(QUATERNION_KEYS):
        roll, pitch, yaw = numbers(entry, RPY_KEYS)
        return quaternion_from_rpy(roll, pitch, yaw)
    values = numbers(entry, QUATERNION_KEYS)
    norm = math.sqrt(sum(value * value for value in values))
    if norm < 1e-6:
        raise entry.fault("the quaternion has no length; give a rotation")
    return tuple(value / norm for value in values)


def numbers(entry: Entry, keys: tuple[str, ...]) -> tuple[float, ...]:
    """Reads a mapping that has exactly some keys, each a number.

    Raises:
        EntryError: It has other keys, or a value is no number.
    """
    fields = {child.key: child for child in entry.children()}
    if set(fields) != set(keys):
        raise entry.fault(f"got the keys {sorted(fields)}, expected {list(keys)}")
    return tuple(fields[key].number() for key in keys)


def frame_name(entry: Entry) -> str:
    """Reads the name of a frame; a leading slash is dropped.

    Raises:
        EntryError: It is empty.
    """
    name = entry.text().lstrip("/")
    if not name:
        raise entry.fault("got an empty text, expected the name of a frame")
    return name


def parse_pose(entry: Entry) -> NamedPose:
    """Turns one entry of the file into a pose.

    Args:
        entry: ``reference_frame`` with ``position`` and ``orientation``; or, for a pose of a robot, ``reference_frame``
            and for each link of an end effector its ``position`` and ``orientation``.

    Raises:
        EntryError: A key is missing or a value is not usable.
    """
    fields = {child.key: child for child in entry.children()}
    if "reference_frame" not in fields:
        raise entry.fault("the key 'reference_frame' is missing; name the frame the pose is given in")
    frame = frame_name(fields.pop("reference_frame"))
    if "position" in fields or "orientation" in fields:
        unknown = sorted(set(fields) - {"position", "orientation"})
        if unknown:
            raise entry.fault(f"unknown keys {unknown}; allowed are reference_frame, position and orientation")
        return NamedPose(entry.key, frame, {"": parse_placement(entry)})
    if not fields:
        raise entry.fault("holds no pose; give position and orientation, or those of each end effector's link")
    return NamedPose(entry.key, frame, {link: parse_placement(field) for link, field in fields.items()})


def load_poses(path: Path) -> tuple[list[NamedPose], list[EntryError]]:
    """Reads a file of poses.

    Args:
        path: YAML file, name to pose.

    Returns:
        The usable poses in file order, and one error for each entry (or for the file) that is not usable.
    """
    poses: list[NamedPose] = []
    faults = read_each_entry(path, lambda entry: poses.append(parse_pose(entry)))
    return poses, faults
