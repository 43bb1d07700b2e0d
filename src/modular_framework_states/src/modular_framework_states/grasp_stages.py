# SPDX-License-Identifier: BSD-3-Clause
"""Decides which joint positions stand for the stages of a grasp, so that plans made apart fit together.

Plans to the pregrasp pose, from there to the grasp pose, and on from the grasp pose may be made at the same time by
states that do not talk to each other. An arm has several joint solutions for one pose, so the end of one plan and the
start of the next agree only if both choose the same one. The rule: the solution of a stage is the one nearest to the
solution of the stage before it, and that of the first stage is the one nearest to where the arm is. Whoever starts at a
stage walks the whole chain, with the fingers as they are when the arm gets there, and therefore finds what the others
found.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from modular_framework_core.state_api.option_uses import GRASP_STAGES


class StageError(RuntimeError):
    """A stage of a grasp has no joint positions; the text says which stage and why."""


class IkCommander(Protocol):
    """The part of the arm commander that is needed here."""

    def solve_ik(self, pose: Any, seed: Mapping[str, float] | None = None) -> Any:
        """Finds joint positions for a pose, near a seed."""

    def current_joints(self) -> dict[str, float]:
        """Returns the current joint positions."""


def stage_pose(grasp: Any, stage: str) -> Any:
    """Returns the pose of a stage of a grasp.

    Raises:
        StageError: The stage has no pose.
    """
    pose = getattr(grasp, stage).pose
    if not pose.header.frame_id:
        raise StageError(f"the {stage} of grasp '{grasp.grasp_id}' has no pose: its frame is empty")
    return pose


def arrival_fingers(grasp: Any) -> dict[str, float]:
    """Returns the fingers' positions with which the arm arrives at a grasp: those of its pregrasp posture."""
    posture = grasp.pregrasp.posture
    return dict(zip(posture.name, posture.position, strict=False))


def stage_joints(commander: IkCommander, grasp: Any, stage: str) -> dict[str, float]:
    """Finds the joint positions that stand for a stage of a grasp.

    Args:
        commander: Solves inverse kinematics.
        grasp: modular_framework_core/StandardisedGrasp.
        stage: Pregrasp, grasp or postgrasp.

    Returns:
        {joint: position} of the arm [rad or m].

    Raises:
        StageError: The stage, or one before it, cannot be reached.
    """
    seed = commander.current_joints() | arrival_fingers(grasp)
    joints: dict[str, float] = {}
    for earlier in GRASP_STAGES[: GRASP_STAGES.index(stage) + 1]:
        joints = near_joints(commander, grasp, earlier, seed)
        seed = seed | joints
    return joints


def near_joints(commander: IkCommander, grasp: Any, stage: str, seed: Mapping[str, float]) -> dict[str, float]:
    """Finds the joint positions for the pose of a stage that are nearest to given ones.

    Raises:
        StageError: The stage cannot be reached.
    """
    result = commander.solve_ik(stage_pose(grasp, stage), seed)
    if not result:
        raise StageError(
            f"the {stage} pose of grasp '{grasp.grasp_id or 'without id'}' has no joint solution: {result.reason}"
        )
    return dict(result.joints)
