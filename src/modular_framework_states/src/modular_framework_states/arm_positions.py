# SPDX-License-Identifier: BSD-3-Clause
"""Executes an arm motion and compares the final joint positions with its last point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_core.state_api.framework_state import FrameworkState

SETTLE_TIME_S = 2.0


def worst_joint(current: Mapping[str, float], target: Mapping[str, float]) -> tuple[str, float]:
    """Returns the joint with the largest deviation, and the deviation [rad or m]; infinite for an unknown position."""
    distances = {joint: abs(current.get(joint, float("inf")) - position) for joint, position in target.items()}
    worst = max(distances, key=distances.__getitem__)
    return worst, distances[worst]


def run_to_end(state: FrameworkState, commander: Any, motion: Any, goal_tolerance: float, label: str) -> str:
    """Executes a motion for a state; the outcome is positive only if the joints are at the last point afterwards.

    Args:
        state: State that executes the motion; preempting it stops the motion.
        commander: Arm commander.
        motion: moveit_msgs/RobotTrajectory with at least one point.
        goal_tolerance: Maximum deviation of a joint from the last point [rad or m].
        label: Description of the motion for reasons, for example ``plan 'up'``.
    """
    result = commander.execute_plan(motion, stop_requested=state.preempt_requested)
    if state.preempt_requested():
        return state.stopped()
    if not result:
        return state.fail(f"{label} was not completed: {result.reason}")
    trajectory = motion.joint_trajectory
    last = dict(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=True))
    if state.wait_until(lambda: worst_joint(commander.positions_of(last), last)[1] <= goal_tolerance, SETTLE_TIME_S):
        return state.succeed()
    if state.preempt_requested():
        return state.stopped()
    joint, distance = worst_joint(commander.positions_of(last), last)
    return state.fail(
        f"{label} was executed, but joint '{joint}' is {distance:.4f} away from its last point; the tolerance "
        f"is {goal_tolerance}"
    )
