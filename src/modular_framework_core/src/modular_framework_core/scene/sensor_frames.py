# SPDX-License-Identifier: BSD-3-Clause
"""Reads sensor poses as fixed transforms between frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import yaml

from modular_framework_core.files.yaml_entries import Entry, EntryError, read_each_entry
from modular_framework_core.managers.named_poses import NamedPose, Placement, frame_name, parse_pose
from modular_framework_urdf.rotations import quaternion_from_rpy

FRAME_KEYS = ("frame_id", "origin_frame_id", "frame_x", "frame_y", "frame_z", "frame_roll", "frame_pitch", "frame_yaw")


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """A sensor frame, fixed in a parent frame.

    Attributes:
        sensor: Name of the sensor in the file.
        parent_frame: Parent frame.
        frame: Sensor frame.
        placement: Pose of the sensor frame in the parent frame.
    """

    sensor: str
    parent_frame: str
    frame: str
    placement: Placement


PoseLookup = Callable[[str], "NamedPose | None"]


def parse_sensor(entry: Entry, lookup: PoseLookup) -> SensorFrame:
    """Returns the sensor frame of an entry.

    Args:
        entry: Mapping with the eight ``FRAME_KEYS``, or with ``frame_id`` and ``initial_pose``, which is a pose or the
            name of a stored pose.
        lookup: Function that returns a named pose, or None if unknown.

    Raises:
        EntryError: Keys are missing, or a value has the wrong type.
    """
    fields = {child.key: child for child in entry.children()}
    if "initial_pose" in fields:
        return _from_initial_pose(entry, fields, lookup)
    missing = [key for key in FRAME_KEYS if key not in fields]
    if missing:
        raise entry.fault(f"the keys {missing} are missing; a sensor needs {list(FRAME_KEYS)}")
    x, y, z, roll, pitch, yaw = (fields[key].number() for key in FRAME_KEYS[2:])
    return SensorFrame(
        entry.key,
        frame_name(fields["origin_frame_id"]),
        frame_name(fields["frame_id"]),
        Placement((x, y, z), quaternion_from_rpy(roll, pitch, yaw)),
    )


def _from_initial_pose(entry: Entry, fields: dict[str, Entry], lookup: PoseLookup) -> SensorFrame:
    if "frame_id" not in fields:
        raise entry.fault("the key 'frame_id' is missing; name the frame of the sensor")
    field = fields["initial_pose"]
    pose = lookup(field.text()) if isinstance(field.node, yaml.ScalarNode) else parse_pose(field)
    if pose is None:
        raise field.fault(f"no pose named '{field.text()}' is stored; add it to the named poses or correct the name")
    if pose.is_robot_pose:
        raise fields["initial_pose"].fault(
            "the keys ['position', 'orientation'] are missing; a pose needs reference_frame, position, orientation"
        )
    return SensorFrame(entry.key, pose.reference_frame, frame_name(fields["frame_id"]), pose.placements[""])


def load_sensor_frames(
    path: Path, lookup: PoseLookup = lambda name: None
) -> tuple[list[SensorFrame], list[EntryError]]:
    """Reads a file of sensors.

    Args:
        path: YAML file. Top-level mappings are sensors; single values such as topic names are ignored.
        lookup: Function that returns a named pose, or None if unknown.

    Returns:
        The valid frames in file order, and one error per invalid sensor or for an unreadable file.
    """
    frames: dict[str, SensorFrame] = {}

    def add_frame(entry: Entry) -> None:
        if isinstance(entry.node, yaml.ScalarNode):
            return
        frame = parse_sensor(entry, lookup)
        if frame.frame in frames:
            raise entry.fault(f"frame '{frame.frame}' already belongs to sensor '{frames[frame.frame].sensor}'")
        if frame.frame == frame.parent_frame:
            raise entry.fault(f"frame '{frame.frame}' is its own origin; name a different origin frame")
        frames[frame.frame] = frame

    _, faults = read_each_entry(path, add_frame)
    return list(frames.values()), faults
