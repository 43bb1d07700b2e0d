# SPDX-License-Identifier: BSD-3-Clause
"""Reads files of named trajectories, which are lists of named joint states with times."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.yaml_entries import Entry, EntryError, read_each_entry
from modular_framework_ros.allowed_names import nearest

WAYPOINT_KEYS = ("name", "interpolate_time", "pause_time")

JointLookup = Callable[[str], Mapping[str, float] | None]


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A waypoint of a trajectory.

    Attributes:
        entry: File entry of the waypoint.
        joint_state_name: Name of the joint state.
        interpolate_time_s: Duration of the motion from the previous waypoint [s].
        pause_time_s: Duration of the pause at the waypoint [s].
    """

    entry: Entry
    joint_state_name: str
    interpolate_time_s: float
    pause_time_s: float


@dataclass(frozen=True, slots=True)
class TimedTrajectory:
    """A named trajectory of joint positions.

    Attributes:
        name: Name of the trajectory.
        joint_names: Joint names in alphabetical order.
        points: Pairs of positions [rad or m], in the order of ``joint_names``, and time from start [s].
    """

    name: str
    joint_names: tuple[str, ...]
    points: tuple[tuple[tuple[float, ...], float], ...]


def parse_waypoint(entry: Entry) -> Waypoint:
    """Returns the waypoint of a list item.

    Args:
        entry: Mapping with ``name``, ``interpolate_time`` (> 0) and optionally ``pause_time`` (>= 0) [s].

    Raises:
        EntryError: A key is missing or unknown, or a time is out of range.
    """
    fields = {child.key: child for child in entry.children()}
    unknown = sorted(set(fields) - set(WAYPOINT_KEYS))
    if unknown:
        raise entry.fault(f"unknown keys {unknown}; allowed: {list(WAYPOINT_KEYS)}")
    missing = [key for key in ("name", "interpolate_time") if key not in fields]
    if missing:
        raise entry.fault(f"the keys {missing} are missing; every waypoint needs 'name' and 'interpolate_time'")
    interpolate_time_s = fields["interpolate_time"].number()
    if interpolate_time_s <= 0.0:
        raise fields["interpolate_time"].fault(f"got {interpolate_time_s} s, must be more than 0")
    pause_time_s = fields["pause_time"].number() if "pause_time" in fields else 0.0
    if pause_time_s < 0.0:
        raise fields["pause_time"].fault(f"got {pause_time_s} s, must be 0 or more")
    return Waypoint(entry, fields["name"].text(), interpolate_time_s, pause_time_s)


def time_trajectory(
    name: str, waypoints: list[Waypoint], lookup: JointLookup, known_states: Collection[str] = ()
) -> TimedTrajectory:
    """Returns the trajectory through waypoints; a pause adds a second point with the same positions.

    Args:
        name: Name of the trajectory.
        waypoints: At least one waypoint.
        lookup: Function that returns {joint: position [rad or m]} of a named joint state, or None if unknown.
        known_states: Names of joint states for the message on an unknown one.

    Raises:
        EntryError: A joint state is unknown, or its joints differ from the joints of the first waypoint.
    """
    joint_names: tuple[str, ...] = ()
    points: list[tuple[tuple[float, ...], float]] = []
    time_s = 0.0
    for waypoint in waypoints:
        joints = lookup(waypoint.joint_state_name)
        if not joints:
            raise waypoint.entry.fault(
                f"no joint state named '{waypoint.joint_state_name}' is stored; "
                "add it to the named joint states or correct the name"
                f"{nearest(waypoint.joint_state_name, known_states)}"
            )
        names = tuple(sorted(joints))
        joint_names = joint_names or names
        if names != joint_names:
            raise waypoint.entry.fault(
                f"joint state '{waypoint.joint_state_name}' has the joints {list(names)}, "
                f"the first waypoint has {list(joint_names)}; they must be the same"
            )
        positions = tuple(joints[joint] for joint in joint_names)
        time_s += waypoint.interpolate_time_s
        points.append((positions, time_s))
        if waypoint.pause_time_s > 0.0:
            time_s += waypoint.pause_time_s
            points.append((positions, time_s))
    return TimedTrajectory(name, joint_names, tuple(points))


def load_trajectories(
    path: Path, lookup: JointLookup, known_states: Collection[str] = ()
) -> tuple[list[TimedTrajectory], list[EntryError]]:
    """Reads a file of trajectories.

    Args:
        path: YAML file, name to list of waypoints.
        lookup: Function that returns {joint: position [rad or m]} of a named joint state, or None if unknown.
        known_states: Names of joint states for the message on an unknown one.

    Returns:
        The valid trajectories in file order, and one error per invalid entry or for an unreadable file.
    """

    def parse_trajectory(entry: Entry) -> TimedTrajectory:
        waypoints = [parse_waypoint(item) for item in entry.items()]
        if not waypoints:
            raise entry.fault("contains no waypoint; write at least one waypoint")
        return time_trajectory(entry.key, waypoints, lookup, known_states)

    return read_each_entry(path, parse_trajectory)
