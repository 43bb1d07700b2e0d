# SPDX-License-Identifier: BSD-3-Clause
"""Finds invalid positions in a message: non-finite values and lists whose length differs from the number of joints."""

from __future__ import annotations

import math
from typing import Any

from modular_framework_core.managers.message_files import fields_of

_LISTS = ("position", "positions")
_COORDINATES = ("geometry_msgs/Point", "geometry_msgs/Quaternion")
_VALUES_OF_JOINTS = {
    "trajectory_msgs/JointTrajectory": ("positions", "velocities", "accelerations", "effort"),
    "trajectory_msgs/MultiDOFJointTrajectory": ("transforms", "velocities", "accelerations"),
}
"""Fields of a trajectory point that are empty or have a value for each joint name, by type of the trajectory."""


def position_fault(message: Any, where: str = "") -> str:
    """Returns the fault of the first invalid position in a message, or "" if all positions are valid.

    Args:
        message: Message whose joint positions, points and orientations are checked at any depth.
        where: Path to the message inside the outermost message, for the returned text; "" for the outermost message.
    """
    if message._type == "sensor_msgs/JointState":
        fault = _count_fault(message, ("position", "velocity", "effort"), len(message.name), where)
        if fault:
            return fault
    for index, point in enumerate(message.points if message._type in _VALUES_OF_JOINTS else ()):
        place = f"{where}.points[{index}]"
        fault = _count_fault(point, _VALUES_OF_JOINTS[message._type], len(message.joint_names), place)
        if fault:
            return fault
    is_coordinate = message._type in _COORDINATES
    for name, part, is_list in fields_of(message.__class__):
        value = getattr(message, name)
        path = f"{where}.{name}".lstrip(".")
        if part is not None and is_list:
            fault = next(
                (text for index, item in enumerate(value) if (text := position_fault(item, f"{path}[{index}]"))),
                "",
            )
        elif part is not None:
            fault = position_fault(value, path) if hasattr(value, "_type") else ""
        elif is_list and name in _LISTS:
            fault = _list_fault(value, path)
        else:
            fault = f"{path} is {value}" if is_coordinate and not math.isfinite(value) else ""
        if fault:
            return fault
    return ""


def _count_fault(message: Any, fields: tuple[str, ...], joint_count: int, where: str) -> str:
    """Returns the fault of the first field that is neither empty nor has a value for each joint name, or ""."""
    for name in fields:
        if (count := len(getattr(message, name))) not in (0, joint_count):
            return f"{where}.{name}".lstrip(".") + f" has {count} values for {joint_count} names"
    return ""


def _list_fault(values: Any, path: str) -> str:
    if math.isfinite(sum(values)):  # fast path; an overflowing sum falls through to the exact check
        return ""
    return next((f"{path}[{index}] is {value}" for index, value in enumerate(values) if not math.isfinite(value)), "")
