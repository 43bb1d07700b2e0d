# SPDX-License-Identifier: BSD-3-Clause
"""Runs a motion of the arm to its end, and compares the joint positions with those of its last point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_core.state_api.framework_state import FrameworkState

SETTLE_TIME_S = 2.0


def worst_joint(current: Mapping[str, float], wanted: Mapping[str, float]) -> tuple[str, float]:
    """Returns the joint farthest from where it should be, and how far it is [rad or m]; infinitely far when unknown."""
    distances = {joint: abs(current.get(joint, float("inf")) - position) for joint, position in wanted.items()}
    worst = max(distances, key=distances.__getitem__)
    return worst, distances[worst]


def run_to_end(state: FrameworkState, commander: Any, motion: Any, goal_tolerance: float, what: str) -> str:
    """Runs a motion for a state; returns its outcome, positive only when the joints are at the last point afterwards.

    Args:
        state: The state that runs it; a request to preempt it stops the motion.
        commander: Of the arm.
        motion: moveit_msgs/RobotTrajectory with at least one point.
        goal_tolerance: Greatest distance of a joint from the last point [rad or m].
        what: Name of the motion in reasons, for example ``plan 'up'``.
    """
    result = commander.execute_plan(motion, stop_requested=state.preempt_requested)
    if state.preempt_requested():
        return state.stopped()
    if not result:
        return state.fail(f"{what} was not executed to its end: {result.reason}")
    trajectory = motion.joint_trajectory
    last = dict(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=True))
    if state.wait_until(lambda: worst_joint(commander.positions_of(last), last)[1] <= goal_tolerance, SETTLE_TIME_S):
        return state.succeed()
    if state.preempt_requested():
        return state.stopped()
    joint, distance = worst_joint(commander.positions_of(last), last)
    return state.fail(
        f"{what} was executed, but joint '{joint}' is {distance:.4f} away from its last point, allowed "
        f"is {goal_tolerance}"
    )
