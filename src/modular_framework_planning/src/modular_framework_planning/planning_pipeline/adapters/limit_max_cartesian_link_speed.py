# SPDX-License-Identifier: BSD-3-Clause
"""Cartesian speed limit of a link, max_cartesian_speed of a request."""

from __future__ import annotations

import math
from dataclasses import replace

from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot
from modular_framework_planning.constraints.robot_frames import frame_on_robot, require_holding_link
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanNext, PlanningProblem
from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import time_path
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.trajectory_processing.link_speed import MovedFrame, with_limited_link_speed


class LimitMaxCartesianLinkSpeed(RequestAdapter):
    """Slows a motion down to max_cartesian_speed; the limited link is the group's tip by default.

    The link can also be a held object or its subframe.
    """

    def adapt_and_plan(self, problem: PlanningProblem, plan_next: PlanNext) -> PlannedPath:
        """Plans and slows the motion down where the link is too fast.

        Raises:
            PlanningError: The speed is negative or not finite, or the link does not exist.
        """
        max_speed = problem.request.max_cartesian_speed
        if max_speed == 0.0:
            return plan_next(problem)
        if not (math.isfinite(max_speed) and max_speed > 0.0):
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"max_cartesian_speed is {max_speed} m/s; it must be above 0, or 0 for no limit",
            )
        frame = self._limited_frame(problem)
        path = plan_next(problem)
        timed = path if path.trajectory is not None else time_path(problem, path)
        assert timed.trajectory is not None
        return replace(
            timed,
            trajectory=with_limited_link_speed(
                timed.trajectory,
                MovedFrame(problem.model, frame, problem.motion.full_positions),
                max_speed,
                problem.max_velocity,
                problem.max_acceleration,
            ),
        )

    @staticmethod
    def _limited_frame(problem: PlanningProblem) -> FrameOnRobot:
        link = problem.request.cartesian_speed_limited_link or problem.group.tip_link
        if not link:
            raise PlanningError(
                ErrorCode.INVALID_LINK_NAME,
                f"max_cartesian_speed: group '{problem.group.name}' has no tip link; set cartesian_speed_limited_link",
            )
        require_holding_link(problem.scene, link, "cartesian_speed_limited_link")
        return frame_on_robot(problem.scene, link)
