# SPDX-License-Identifier: BSD-3-Clause
"""Planner of the pipeline pilz_industrial_motion_planner: one PTP, LIN or CIRC motion per request.

The planner does not avoid obstacles. It returns exactly the requested motion or raises an error with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.planners.pilz.auxiliary_point import CENTRE, INTERIM
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits, read_cartesian_limits
from modular_framework_planning.planners.pilz.commands import MotionSettings, along_path, point_to_point
from modular_framework_planning.planners.pilz.joint_motion import JointRateLimits
from modular_framework_planning.planners.pilz.pose_path import (
    LinePath,
    PosePath,
    arc_around_centre,
    arc_through_interim,
)
from modular_framework_planning.planning_interface.planner_interface import Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import JointGoal, PipelineSettings, PoseGoal
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

DEFAULT_SAMPLING_TIME_S = 0.1
MAX_START_VELOCITY = 0.01  # upper limit of measurement noise on the velocity of a joint at rest [rad/s or m/s]


@dataclass(frozen=True, slots=True, eq=False)
class _Target:
    """Goal pose of a frame that a link carries, and the joint values of a joint goal."""

    link: str
    pose: Transform
    values: Array | None = None
    carried: Transform | None = None


class CommandPlanner(Planner):
    """Plans PTP, LIN and CIRC."""

    planner_ids = ("PTP", "LIN", "CIRC")
    replaces_bad_values = False
    auxiliary_constraints = (CENTRE, INTERIM)
    collision_code = ErrorCode.INVALID_MOTION_PLAN  # as in MoveIt, whose generators do not check collisions

    def __init__(
        self, cartesian_limits: Mapping[str, Any] | None, sampling_time_s: float = DEFAULT_SAMPLING_TIME_S
    ) -> None:
        """Stores the limits.

        Args:
            cartesian_limits: Entries max_trans_vel, max_trans_acc, max_trans_dec and max_rot_vel; optional for PTP.
            sampling_time_s: Sampling period of the trajectories [s].

        Raises:
            ModelError: The sampling time is not above 0, or a limit is invalid.
        """
        if not (math.isfinite(sampling_time_s) and sampling_time_s > 0.0):
            raise ModelError(f"sampling_time is {sampling_time_s}; it must be above 0 s")
        self.sampling_time_s = sampling_time_s
        self._limits = read_cartesian_limits(cartesian_limits) if cartesian_limits else None

    @classmethod
    def configure(cls, _model: RobotModel, settings: PipelineSettings) -> CommandPlanner:
        """Returns the planner with the parameters robot_description_planning/cartesian_limits and sampling_time."""
        return cls(
            settings.robot_planning.get("cartesian_limits"),
            float(settings.parameters.get("sampling_time", DEFAULT_SAMPLING_TIME_S)),
        )

    def plan(self, problem: PlanningProblem) -> Trajectory:
        """Returns the requested motion; raises PlanningError with the reason if it is impossible."""
        if problem.cancelled():
            raise PlanningError(ErrorCode.PREEMPTED, f"{problem.planner_id} was cancelled before it began")
        _require_start_at_rest(problem)
        if len(problem.request.goals) != 1:
            raise PlanningError(
                ErrorCode.INVALID_GOAL_CONSTRAINTS,
                f"goal_constraints has {len(problem.request.goals)} goals; {problem.planner_id} needs exactly one",
            )
        if not isinstance(problem.request.goals[0], JointGoal | PoseGoal):
            raise PlanningError(
                ErrorCode.INVALID_GOAL_CONSTRAINTS,
                f"goal_constraints: {problem.planner_id} needs "
                "either joint constraints, or one position and one orientation constraint of the same link",
            )
        settings = self._motion_settings(problem)
        match problem.planner_id:
            case "PTP" | "":
                limits = JointRateLimits.of(problem.model, problem.group)
                return point_to_point(problem.start_values, problem.goal_states()[0], limits, settings)
            case "LIN" | "CIRC":
                return self._along_path(problem, settings)
        raise PlanningError(
            ErrorCode.PLANNING_FAILED, f"planner_id '{problem.planner_id}' must be one of {', '.join(self.planner_ids)}"
        )

    def _motion_settings(self, problem: PlanningProblem) -> MotionSettings:
        """Recovers the scaling factors from the scaled limits, in which a factor of 0 is replaced by the default."""
        indices = problem.group.indices
        return MotionSettings(
            float((problem.max_velocity / problem.model.max_velocity[indices]).min()),
            float((problem.max_acceleration / problem.model.max_acceleration[indices]).min()),
            self.sampling_time_s,
        )

    def _along_path(self, problem: PlanningProblem, settings: MotionSettings) -> Trajectory:
        limits = self._require_limits(problem.planner_id)
        solver = problem.kinematics.solver(problem.group.name)
        target = _target(problem)
        follower = PoseFollower(solver, target.link, problem.start, target.carried)
        path = _path(problem, follower.pose(problem.start_values), target.pose)
        return along_path(path, follower, problem.start_values, limits, settings=settings, goal=target.values)

    def _require_limits(self, planner_id: str) -> CartesianLimits:
        if self._limits is None:
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"{planner_id}: robot_description_planning/cartesian_limits is not set; load a "
                "pilz_cartesian_limits.yaml with max_trans_vel, max_trans_acc, max_trans_dec and max_rot_vel",
            )
        return self._limits


def _require_start_at_rest(problem: PlanningProblem) -> None:
    for name, velocity in problem.request.start_velocities.items():
        if name in problem.group.joints and not abs(velocity) <= MAX_START_VELOCITY:
            raise PlanningError(
                ErrorCode.INVALID_ROBOT_STATE,
                f"start state: joint '{name}' moves at {velocity}; "
                f"{problem.planner_id} starts from rest (at most {MAX_START_VELOCITY}); wait until the robot stops",
            )


def _target(problem: PlanningProblem) -> _Target:
    goal = problem.request.goals[0]
    values = np.asarray(problem.goal_states()[0])
    if isinstance(goal, PoseGoal):
        moved = goal.target if goal.carried is None else goal.target * goal.carried
        return _Target(goal.link, moved, carried=goal.carried)
    link = problem.group.tip_link
    follower = PoseFollower(problem.kinematics.solver(problem.group.name), link, problem.start)
    return _Target(link, follower.pose(values), values if isinstance(goal, JointGoal) else None)


def _path(problem: PlanningProblem, start: Transform, end: Transform) -> PosePath:
    if problem.planner_id == "LIN":
        return LinePath.between(start, end)
    auxiliary = problem.request.auxiliary_point
    if auxiliary is None:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"CIRC: path_constraints must have the name '{CENTRE}' or "
            f"'{INTERIM}' and a position constraint with the auxiliary point",
        )
    return (arc_around_centre if auxiliary.name == CENTRE else arc_through_interim)(start, end, auxiliary.position)
