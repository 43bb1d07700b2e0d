# SPDX-License-Identifier: BSD-3-Clause
"""Converts the transform of a planar or floating base to the values of its variables, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping

from geometry_msgs.msg import Quaternion, Transform, Vector3

from moveit_commander.robot_model import RobotModel

PLANAR = "planar"


def base_values(model: RobotModel, transform: Transform) -> dict[str, float]:
    """Returns the variables of the robot's base for a transform; a planar base uses only x, y and the heading.

    Args:
        model: Model of a robot with a planar or floating base.
        transform: Transform from the root link to the parent frame of the base.
    """
    t, q = transform.translation, transform.rotation
    if model.base is not None and model.base.kind == PLANAR:
        heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        values = [t.x, t.y, heading]
    else:
        values = [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
    return {variable.name: value for variable, value in zip(model.base_variables, values, strict=True)}


def base_transform(model: RobotModel, positions: Mapping[str, float]) -> Transform:
    """Returns the transform of the robot's base for the values of its variables; normalises the quaternion."""
    values = [positions[variable.name] for variable in model.base_variables]
    if model.base is not None and model.base.kind == PLANAR:
        x, y, heading = values
        return Transform(Vector3(x, y, 0.0), Quaternion(0.0, 0.0, math.sin(heading / 2.0), math.cos(heading / 2.0)))
    length = math.hypot(*values[3:]) or 1.0
    return Transform(Vector3(*values[:3]), Quaternion(*(number / length for number in values[3:])))
