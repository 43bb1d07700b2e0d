# SPDX-License-Identifier: BSD-3-Clause
"""Builds messages for move_group and names its error codes."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import Constraints, MoveItErrorCodes, RobotState
from sensor_msgs.msg import JointState

from modular_framework_ros.messages.ros_goal_constraints import orientation_goal, position_goal

JOINT_TOLERANCE_RAD = 1e-4
POSITION_TOLERANCE_M = 1e-4
ORIENTATION_TOLERANCE_RAD = 1e-3

StartState = RobotState | JointState | Mapping[str, float] | None


def error_name(code: int) -> str:
    """Returns the name of an error code, or its number if unknown."""
    for name, value in vars(MoveItErrorCodes).items():
        if name.isupper() and isinstance(value, int) and value == code:
            return name
    return f"error code {code}"


def robot_state(state: StartState) -> RobotState:
    """Returns a robot state as a difference to the current state: other joints and attached objects stay unchanged.

    Args:
        state: {joint: position [rad or m]}, joint state or robot state; None for the current state.
    """
    match state:
        case None:
            return RobotState(is_diff=True)
        case RobotState():
            difference = copy.copy(state)  # the caller's message stays unchanged
            difference.is_diff = True
            return difference
        case JointState():
            return RobotState(joint_state=state, is_diff=True)
        case _:
            joints = JointState(name=list(state), position=list(state.values()))
            return RobotState(joint_state=joints, is_diff=True)


def pose_goal(pose: PoseStamped, link: str, name: str = "") -> Constraints:
    """Returns a goal for the pose of a link.

    Args:
        pose: Target pose.
        link: Name of the link.
        name: Name of the constraints.
    """
    return Constraints(
        name=name,
        position_constraints=[position_goal(link, pose, POSITION_TOLERANCE_M)],
        orientation_constraints=[orientation_goal(link, pose, ORIENTATION_TOLERANCE_RAD)],
    )


def joints_of(state: JointState, names: Sequence[str]) -> dict[str, float]:
    """Returns the positions of the named joints in a joint state. Missing joints are omitted."""
    positions = dict(zip(state.name, state.position, strict=False))
    return {name: positions[name] for name in names if name in positions}


def describe_pose(pose: PoseStamped) -> str:
    """Returns a position as text for error messages."""
    p = pose.pose.position
    return f"({p.x:.3f}, {p.y:.3f}, {p.z:.3f}) m in frame '{pose.header.frame_id}'"
