# SPDX-License-Identifier: BSD-3-Clause
"""Finds positions in a message that are not finite, or not one for each joint: planners and controllers refuse them."""

from __future__ import annotations

import math
from typing import Any

from modular_framework_core.managers.message_files import fields_of

_LISTS = ("position", "positions")
_COORDINATES = ("geometry_msgs/Point", "geometry_msgs/Quaternion")


def unusable_position(message: Any, where: str = "") -> str:
    """Describes the first position of a message that is not finite, or has no joint; "" when there is none.

    Args:
        message: Any message; its joint positions, points and orientations are checked at any depth.
        where: Its own field, for the text.
    """
    if message._type == "sensor_msgs/JointState":
        for name in ("position", "velocity", "effort"):
            if (count := len(getattr(message, name))) not in (0, len(message.name)):
                return f"{where}.{name}".lstrip(".") + f" has {count} values for {len(message.name)} names"
    is_place = message._type in _COORDINATES
    for name, part, is_list in fields_of(message.__class__):
        value = getattr(message, name)
        path = f"{where}.{name}".lstrip(".")
        if part is not None and is_list:
            found = next(
                (text for number, item in enumerate(value) if (text := unusable_position(item, f"{path}[{number}]"))),
                "",
            )
        elif part is not None:
            found = unusable_position(value, path) if hasattr(value, "_type") else ""
        elif is_list and name in _LISTS:
            found = _unusable_in(value, path)
        else:
            found = f"{path} is {value}" if is_place and not math.isfinite(value) else ""
        if found:
            return found
    return ""


def _unusable_in(values: Any, path: str) -> str:
    if math.isfinite(sum(values)):  # quick, and right for all but sums beyond the greatest number
        return ""
    return next((f"{path}[{number}] is {value}" for number, value in enumerate(values) if not math.isfinite(value)), "")
