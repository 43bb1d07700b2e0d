# SPDX-License-Identifier: BSD-3-Clause
"""Describes the actions that a task requires from a policy, with the limits of the robot description."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mbf_method.observation import END_EFFECTOR_COLUMNS, END_EFFECTOR_DELTAS, GRIPPER_COLUMN, ActionSpec
from modular_framework_core.commander.robot_groups import Group


def joint_action_spec(
    group: Group, joints: Sequence[str], kind: str, *, has_gripper: bool, timing: tuple[int, float], accelerates: bool
) -> ActionSpec:
    """Returns the required joint actions.

    Args:
        group: Planning group with the limits of the joints.
        joints: Joints that the actions move; empty for all joints of the group.
        kind: Meaning of the joint columns.
        has_gripper: Whether the last column is the gripper.
        timing: Number of actions of a chunk, and number of actions per second.
        accelerates: Whether the acceleration limits of the joints count.

    Raises:
        RobotModelError: A joint is not in the group.
    """
    horizon, rate_hz = timing
    limits = [group.joint(name) for name in joints or group.joint_names]
    rows = [
        (joint.lower, joint.upper, joint.velocity, joint.acceleration if accelerates else math.inf) for joint in limits
    ]
    rows += [(0.0, 1.0, math.inf, math.inf)] * has_gripper
    lower, upper, velocity, acceleration = np.array(rows, dtype=np.float64).T
    names = (*(joint.name for joint in limits), *[GRIPPER_COLUMN] * has_gripper)
    return ActionSpec(kind, names, horizon, rate_hz, lower, upper, velocity, acceleration)


def end_effector_spec(positions: ActionSpec, link: str, frame: str) -> ActionSpec:
    """Returns the required end-effector deltas.

    Args:
        positions: Joint positions that result from the deltas, with the gripper column.
        link: Link that the deltas move.
        frame: Frame whose axes the deltas use.
    """
    joints, free = len(positions.joint_names), np.full(len(END_EFFECTOR_COLUMNS), math.inf)
    return replace(
        positions,
        kind=END_EFFECTOR_DELTAS,
        names=(*END_EFFECTOR_COLUMNS, *positions.names[joints:]),
        lower=np.append(-free, positions.lower[joints:]),
        upper=np.append(free, positions.upper[joints:]),
        max_velocity=np.append(free, positions.max_velocity[joints:]),
        max_acceleration=np.append(free, positions.max_acceleration[joints:]),
        link=link,
        frame=frame,
    )
