# SPDX-License-Identifier: BSD-3-Clause
"""Services compute_ik and compute_fk."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.srv import (
    GetPositionFK,
    GetPositionFKResponse,
    GetPositionIK,
    GetPositionIKResponse,
)

from modular_framework_planning.constraints.robot_frames import require_holding_link
from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.solution_choice import clearest, first_free
from modular_framework_planning.messages.constraint_conversions import constraints_from_message
from modular_framework_planning.messages.conversions import scene_with_state, state_message
from modular_framework_planning.messages.multi_dof import names_joints
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import MoveGroupCapability
from modular_framework_planning.move_group.ik_targets import (
    combined_solutions,
    ik_targets,
    sampled_solutions,
    solvers_of,
)
from modular_framework_planning.move_group.pipeline_parameters import launch_seed
from modular_framework_planning.planning_scene.planning_scene import PlanningScene

MAX_COMPARED = 4  # collision-free solutions whose clearances are compared


class KinematicsService(MoveGroupCapability):
    """Offers compute_ik (GetPositionIK) and compute_fk (GetPositionFK).

    As in MoveIt, pose_stamped_vector with ik_link_names requests several tips of a group with one chain per tip.
    Links may be attached objects and their subframes ("object/subframe").
    """

    def connect(self) -> None:
        """Advertises both services."""
        rospy.Service(names.IK_SERVICE, GetPositionIK, self._serve_ik)
        rospy.Service(names.FK_SERVICE, GetPositionFK, self._serve_fk)

    def _scene(self, state: Any) -> PlanningScene:
        if not names_joints(state) or state.is_diff:
            self._context.monitor.wait_for_state()
        scene = scene_with_state(self._context.monitor.snapshot(), state)
        if not np.isfinite(scene.positions).all():
            raise PlanningError(ErrorCode.INVALID_ROBOT_STATE, "robot_state: a joint position is not finite")
        return scene

    def _serve_ik(self, service: Any) -> GetPositionIKResponse:
        request = service.ik_request
        response = GetPositionIKResponse()
        details = {"group": request.group_name}
        try:
            scene = self._scene(request.robot_state)
            positions = self._solve(scene, request)
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            response.error_code.val = self._context.reporter.failure("ik", error, **details)
            return response
        response.solution = state_message(scene, positions)
        response.error_code.val = ErrorCode.SUCCESS
        self._context.reporter.report("ik", ErrorCode.SUCCESS, "", **details)
        return response

    def _solve(self, scene: PlanningScene, request: Any) -> Array:
        """Returns a valid solution near the seed; raises PlanningError with the cause.

        If no solution of the solvers is valid and the solvers may have missed solutions, the remaining time is spent on
        a search that includes the constraints.
        """
        start = time.monotonic()
        group = self._context.model.group(request.group_name)
        targets = ik_targets(scene, group, request)
        links = [target.link for target in targets]
        solvers = solvers_of(self._context.kinematics, self._context.model, group, links)
        constraints = constraints_from_message(
            scene, request.constraints, "ik_request.constraints", ErrorCode.NO_IK_SOLUTION, links[0]
        )
        timeout_s = search_time_s(request.timeout.to_sec())
        solutions = combined_solutions(targets, solvers, scene.positions, timeout_s)
        valid = [positions for positions in solutions if constraints.are_satisfied(positions)]
        if valid and not request.avoid_collisions:
            return valid[0]
        checker = self._context.new_checker(scene, group.indices) if request.avoid_collisions else None
        if checker is not None:
            collision_free = first_free(valid, checker.is_free, MAX_COMPARED)
            if collision_free:
                return clearest(collision_free, scene.positions, checker.distance)
        pairs = zip(targets, solvers, strict=True)
        if not all(target.has_complete_solutions(solver, scene.positions) for target, solver in pairs):
            end_s = start + (
                sum(solver.settings.total_timeout_s for solver in solvers) if timeout_s is None else timeout_s
            )
            for positions in sampled_solutions(scene, group, targets, solvers, constraints=constraints, end_s=end_s):
                if checker is None or checker.is_free(positions):
                    return positions
        tips = f"{len(solutions)} inverse kinematics solutions for {', '.join(links)}"
        if not valid:
            reason = f"none of {tips} satisfies the constraints; nearest solution: {constraints.describe(solutions[0])}"
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, reason)
        assert checker is not None
        contacts = describe_contacts(checker.contacts(valid[0], include_fixed=False))
        raise PlanningError(
            ErrorCode.NO_IK_SOLUTION, f"all {len(valid)} of {tips} collide; nearest solution: {contacts}"
        )

    def _serve_fk(self, request: Any) -> GetPositionFKResponse:
        response = GetPositionFKResponse()
        try:
            if not request.fk_link_names:
                raise PlanningError(ErrorCode.INVALID_LINK_NAME, "fk_link_names is empty; name at least one link")
            scene = self._scene(request.robot_state)
            base = scene.frame_transform(request.header.frame_id)
            for link in request.fk_link_names:
                require_holding_link(scene, link, "link")
                stamped = PoseStamped(pose=pose_message(base.actInv(scene.frame_transform(link))))
                stamped.header.frame_id = request.header.frame_id or scene.model.planning_frame
                stamped.header.stamp = rospy.Time.now()
                response.pose_stamped.append(stamped)
                response.fk_link_names.append(link)
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            code = self._context.reporter.failure("fk", error)
            response = GetPositionFKResponse()
            response.error_code.val = code
            return response
        response.error_code.val = ErrorCode.SUCCESS
        return response


def search_time_s(requested_s: float) -> float | None:
    """Returns the time that a search for a solution may take [s], as in MoveIt without a maximum.

    Args:
        requested_s: Timeout of the request [s].

    Returns:
        The time [s]; None for the group's timeout, infinite if /seed is set.
    """
    if launch_seed() is not None:
        return math.inf  # attempt counts bound the search, so that results do not depend on the clock
    return requested_s if requested_s > 0.0 else None
