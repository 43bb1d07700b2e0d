# SPDX-License-Identifier: BSD-3-Clause
"""Selects the joint positions for the stages of a grasp, so that independently made plans fit together.

Plans to the pregrasp pose, from there to the grasp pose, and from the grasp pose may be made at the same time by
independent states. An arm has several joint solutions for a pose, so the end of one plan and the start of the next
agree only if both use the same solution. Therefore, each stage uses the solution nearest to the solution of the
previous stage, and the first stage uses the solution nearest to the current position. A plan that starts at a stage
computes the whole chain, with the fingers in their posture on arrival, and therefore finds the same solutions as the
other plans.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from modular_framework_core.state_api.option_uses import GRASP_STAGES


class StageError(RuntimeError):
    """A stage of a grasp has no joint positions; the message gives the stage and the reason."""


class IkCommander(Protocol):
    """Methods of the arm commander that this module uses."""

    def solve_ik(self, pose: Any, seed: Mapping[str, float] | None = None) -> Any:
        """Returns joint positions for a pose, near a seed."""

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
    """Returns the finger positions on arrival at a grasp: its pregrasp posture."""
    posture = grasp.pregrasp.posture
    return dict(zip(posture.name, posture.position, strict=False))


def stage_joints(commander: IkCommander, grasp: Any, stage: str) -> dict[str, float]:
    """Returns the joint positions for a stage of a grasp.

    Args:
        commander: Arm commander that solves inverse kinematics.
        grasp: modular_framework_core/StandardisedGrasp.
        stage: Stage of the grasp: pregrasp, grasp or postgrasp.

    Returns:
        {joint: position} of the arm [rad or m].

    Raises:
        StageError: The stage or a previous stage cannot be reached.
    """
    seed = commander.current_joints() | arrival_fingers(grasp)
    joints: dict[str, float] = {}
    for earlier in GRASP_STAGES[: GRASP_STAGES.index(stage) + 1]:
        joints = near_joints(commander, grasp, earlier, seed)
        seed = seed | joints
    return joints


def near_joints(commander: IkCommander, grasp: Any, stage: str, seed: Mapping[str, float]) -> dict[str, float]:
    """Returns the joint positions for the pose of a stage that are nearest to a seed.

    Args:
        commander: Arm commander that solves inverse kinematics.
        grasp: modular_framework_core/StandardisedGrasp.
        stage: Stage of the grasp.
        seed: {joint: position} [rad or m].

    Raises:
        StageError: The stage cannot be reached.
    """
    result = commander.solve_ik(stage_pose(grasp, stage), seed)
    if not result:
        raise StageError(
            f"the {stage} pose of grasp '{grasp.grasp_id or 'without id'}' has no joint solution: {result.reason}"
        )
    return dict(result.joints)
