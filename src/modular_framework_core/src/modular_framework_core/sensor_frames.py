# SPDX-License-Identifier: BSD-3-Clause
"""Reads where the sensors stand, as fixed transforms between frames."""
from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import yaml

from modular_framework_core.managers.yaml_entries import Entry, EntryError, take_entries

FRAME_KEYS = ("frame_id", "origin_frame_id", "frame_x", "frame_y", "frame_z", "frame_roll", "frame_pitch", "frame_yaw")
POSITION_KEYS = ("x", "y", "z")
RPY_KEYS = ("r", "p", "y")
QUATERNION_KEYS = ("x", "y", "z", "w")


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """A sensor's frame, fixed in another frame.

    Attributes:
        sensor: Name of the sensor in the file.
        parent_frame: Frame the pose is given in.
        frame: Frame of the sensor.
        position_m: x, y, z of the sensor in the parent frame [m].
        quaternion_xyzw: Orientation of the sensor in the parent frame.
    """

    sensor: str
    parent_frame: str
    frame: str
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Converts fixed-axis roll, pitch, yaw [rad] (REP 103) to a unit quaternion xyzw."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def parse_sensor(entry: Entry) -> SensorFrame:
    """Turns one entry of the file into a frame.

    Args:
        entry: Mapping with the eight ``FRAME_KEYS``, or with ``frame_id`` and an inline ``initial_pose``.

    Returns:
        The frame.

    Raises:
        EntryError: Keys are missing, or a value has the wrong type.
    """
    fields = {child.key: child for child in entry.children()}
    if "initial_pose" in fields:
        return _from_initial_pose(entry, fields)
    missing = [key for key in FRAME_KEYS if key not in fields]
    if missing:
        raise entry.fault(f"the keys {missing} are missing; a sensor needs {list(FRAME_KEYS)}")
    x, y, z, roll, pitch, yaw = (fields[key].number() for key in FRAME_KEYS[2:])
    return SensorFrame(entry.key, _frame_name(fields["origin_frame_id"]), _frame_name(fields["frame_id"]), (x, y, z),
                       quaternion_from_rpy(roll, pitch, yaw))


def _from_initial_pose(entry: Entry, fields: dict[str, Entry]) -> SensorFrame:
    if "frame_id" not in fields:
        raise entry.fault("the key 'frame_id' is missing; name the frame of the sensor")
    pose = {child.key: child for child in fields["initial_pose"].children()}
    missing = [key for key in ("reference_frame", "position", "orientation") if key not in pose]
    if missing:
        raise fields["initial_pose"].fault(f"the keys {missing} are missing; "
                                           "a pose needs reference_frame, position, orientation")
    position = _numbers(pose["position"], POSITION_KEYS)
    names = {child.key for child in pose["orientation"].children()}
    if names == set(QUATERNION_KEYS):
        values = _numbers(pose["orientation"], QUATERNION_KEYS)
        norm = math.sqrt(sum(value * value for value in values))
        if norm < 1e-6:
            raise pose["orientation"].fault("the quaternion has no length; give a rotation")
        orientation = tuple(value / norm for value in values)
    else:
        orientation = quaternion_from_rpy(*_numbers(pose["orientation"], RPY_KEYS))
    return SensorFrame(entry.key, _frame_name(pose["reference_frame"]), _frame_name(fields["frame_id"]),
                       (position[0], position[1], position[2]),
                       (orientation[0], orientation[1], orientation[2], orientation[3]))


def _numbers(entry: Entry, keys: tuple[str, ...]) -> tuple[float, ...]:
    fields = {child.key: child for child in entry.children()}
    if set(fields) != set(keys):
        raise entry.fault(f"got the keys {sorted(fields)}, expected {list(keys)}")
    return tuple(fields[key].number() for key in keys)


def _frame_name(entry: Entry) -> str:
    name = entry.text().lstrip("/")
    if not name:
        raise entry.fault("got an empty text, expected the name of a frame")
    return name


def load_sensor_frames(path: Path) -> tuple[list[SensorFrame], list[EntryError]]:
    """Reads a file of sensors.

    Args:
        path: YAML file; top-level mappings are sensors, single values (topic names and the like) are left alone.

    Returns:
        The usable frames in file order, and one error for each sensor (or for the file) that is not usable.
    """
    frames: dict[str, SensorFrame] = {}

    def take(entry: Entry) -> None:
        if isinstance(entry.node, yaml.ScalarNode):
            return
        frame = parse_sensor(entry)
        if frame.frame in frames:
            raise entry.fault(f"frame '{frame.frame}' belongs to sensor '{frames[frame.frame].sensor}' already")
        if frame.frame == frame.parent_frame:
            raise entry.fault(f"frame '{frame.frame}' is its own origin; name another origin frame")
        frames[frame.frame] = frame

    faults = take_entries(path, take)
    return list(frames.values()), faults
