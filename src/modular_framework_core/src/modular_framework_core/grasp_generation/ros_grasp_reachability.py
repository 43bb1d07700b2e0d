# SPDX-License-Identifier: BSD-3-Clause
"""Checks by inverse kinematics of move_group whether the arm reaches the three poses of a grasp without a collision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from moveit_msgs.msg import MoveItErrorCodes

from modular_framework_core.commander.arm_commander import ArmCommander
from modular_framework_core.msg import StandardisedGrasp
from modular_framework_ros.calls import CallError


@dataclass(frozen=True, slots=True)
class Reach:
    """Reachability of a grasp.

    Attributes:
        reason: Reason why the grasp is not reachable; empty if it is reachable.
        joint_travel: Largest motion of a joint between two consecutive poses of the grasp [rad or m].
    """

    reason: str
    joint_travel: float = 0.0


def check_reach(commander: ArmCommander, grasp: StandardisedGrasp) -> Reach:
    """Searches collision-free joint positions for pregrasp, grasp and postgrasp; the last solution is the next seed.

    Args:
        commander: Connected commander of the arm.
        grasp: Grasp to reach.

    Raises:
        CallError: move_group does not respond.
    """
    posture = grasp.pregrasp.posture
    seed = commander.current_joints() | dict(zip(posture.name, posture.position, strict=True))
    joints: Mapping[str, float] = {}
    travel = 0.0
    for stage in ("pregrasp", "grasp", "postgrasp"):
        result = commander.solve_ik(getattr(grasp, stage).pose, seed)
        if result.error_code == MoveItErrorCodes.COMMUNICATION_FAILURE:
            raise CallError(result.reason)
        if not result:
            return Reach(f"at the {stage} pose, {result.reason}")
        if stage == "pregrasp" and (touching := commander.contacts(result.joints)):
            # the arm reaches the pregrasp pose with the current finger positions; the fingers move afterwards
            return Reach(f"at the pregrasp pose, with the fingers as they are now, the arm is {touching}")
        travel = max([travel, *(abs(value - joints[name]) for name, value in result.joints.items() if name in joints)])
        joints, seed = result.joints, seed | result.joints
    return Reach("", travel)
