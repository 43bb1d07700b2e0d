# SPDX-License-Identifier: BSD-3-Clause
"""Reads the named postures of the manipulator, and makes grasp messages that command them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rospy

from modular_framework_core.commander.robot_groups import RobotModelError, read_group
from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp


def posture_positions(posture: str) -> dict[str, float]:
    """Returns {joint: position} of a named state of the manipulator's planning group.

    Raises:
        RobotModelError: The robot is not loaded, or the group has no such state.
    """
    values = {
        name: str(rospy.get_param(name, ""))
        for name in ("manipulator_group_name", "robot_description", "robot_description_semantic")
    }
    missing = [rospy.resolve_name(name) for name, value in values.items() if not value]
    if missing:
        raise RobotModelError(f"the parameters {', '.join(missing)} are not set; load the robot first")
    group = read_group(
        values["robot_description"], values["robot_description_semantic"], values["manipulator_group_name"]
    )
    if posture not in group.states:
        raise RobotModelError(
            f"group '{group.name}' has no state '{posture}'; it has "
            f"{', '.join(group.states) or 'none'}; name one of them, or add it to the SRDF"
        )
    return group.states[posture]


def posture_grasp(positions: Mapping[str, float], torque: float) -> Any:
    """Returns a grasp message whose stages all have the same posture."""
    pose = generate_pose_stamped_message("world", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    values = list(positions.values())
    return get_standardised_grasp(list(positions), values, values, values, [torque] * len(values), pose, pose, pose)
