# SPDX-License-Identifier: BSD-3-Clause
"""Describes the actions that a task requires from a policy, with the limits of the robot description."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mbf_method.observation import GRIPPER_COLUMN, ActionSpec
from modular_framework_core.commander.robot_groups import Group


def action_spec(
    group: Group, joints: Sequence[str], kind: str, *, has_gripper: bool, timing: tuple[int, float]
) -> ActionSpec:
    """Returns the required actions.

    Args:
        group: Planning group with the limits of the joints.
        joints: Joints that the actions move; empty for all joints of the group.
        kind: Meaning of the joint columns.
        has_gripper: Whether the last column is the gripper.
        timing: Number of actions of a chunk, and number of actions per second.

    Raises:
        RobotModelError: A joint is not in the group.
    """
    horizon, rate_hz = timing
    limits = [group.joint(name) for name in joints or group.joint_names]
    rows = [(joint.lower, joint.upper, joint.velocity) for joint in limits] + [(0.0, 1.0, math.inf)] * has_gripper
    lower, upper, velocity = np.array(rows, dtype=np.float64).T
    names = (*(joint.name for joint in limits), *[GRIPPER_COLUMN] * has_gripper)
    return ActionSpec(kind, names, horizon, rate_hz, lower, upper, velocity)
