# SPDX-License-Identifier: BSD-3-Clause
"""Services compute_ik and compute_fk."""
from __future__ import annotations

from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.srv import (
    GetPositionFK,
    GetPositionFKResponse,
    GetPositionIK,
    GetPositionIKResponse,
)

from modular_framework_planning import capability_names as names
from modular_framework_planning.collision import CollisionChecker
from modular_framework_planning.conversions import (
    pose_message,
    refuse_constraints,
    scene_with_state,
    stamped_in_scene,
    state_message,
)
from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.kinematics import first_free
from modular_framework_planning.pipeline import describe_contacts
from modular_framework_planning.planning_scene import PlanningScene
from modular_framework_planning.ros_context import MoveGroupContext
from modular_framework_planning.spatial import Array

DEFAULT_TIMEOUT_S = 0.05
LONGEST_TIMEOUT_S = 10.0


class KinematicsService:
    """Offers compute_ik (GetPositionIK) and compute_fk (GetPositionFK)."""

    def __init__(self, context: MoveGroupContext) -> None:
        self._context = context

    def connect(self) -> None:
        """Advertises both services."""
        rospy.Service(names.IK_SERVICE, GetPositionIK, self._serve_ik)
        rospy.Service(names.FK_SERVICE, GetPositionFK, self._serve_fk)

    def _scene(self, state: Any) -> PlanningScene:
        if not state.joint_state.name or state.is_diff:
            self._context.monitor.wait_for_state()
        return scene_with_state(self._context.monitor.snapshot(), state)

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
        """Returns the solution nearest to the seed; raises PlanningError with the cause."""
        group = self._context.model.group(request.group_name)
        if request.ik_link_names or request.pose_stamped_vector:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, "several tips at once are not supported; ask for one link "
                                "with ik_link_name and pose_stamped")
        refuse_constraints("ik_request.constraints", request.constraints, ErrorCode.NO_IK_SOLUTION)
        solver = self._context.kinematics.solver(group.name)
        link = request.ik_link_name or group.tip_link
        target = stamped_in_scene(scene, request.pose_stamped, "pose_stamped")
        timeout = request.timeout.to_sec() if request.timeout.to_sec() > 0.0 else DEFAULT_TIMEOUT_S
        found = solver.solutions(link, target, scene.positions, min(timeout, LONGEST_TIMEOUT_S))
        if not found:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, solver.explain_unreachable(link, target, scene.positions))
        if not request.avoid_collisions:
            return found[0]
        checker = CollisionChecker(scene, group.indices)
        free = first_free(found, checker.is_free)
        if free:
            return free[0]
        contacts = describe_contacts(checker.contacts(found[0], include_fixed=False))
        raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"all {len(found)} inverse kinematics solutions for '{link}' "
                            f"collide; the nearest: {contacts}")

    def _serve_fk(self, request: Any) -> GetPositionFKResponse:
        response = GetPositionFKResponse()
        try:
            scene = self._scene(request.robot_state)
            base = scene.frame_transform(request.header.frame_id)
            transforms = scene.model.link_transforms(scene.positions)
            for link in request.fk_link_names:
                if link not in transforms:
                    raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, "link", link, transforms)
                stamped = PoseStamped(pose=pose_message(base.actInv(transforms[link])))
                stamped.header.frame_id = request.header.frame_id or scene.model.planning_frame
                stamped.header.stamp = rospy.Time.now()
                response.pose_stamped.append(stamped)
                response.fk_link_names.append(link)
            if not request.fk_link_names:
                raise PlanningError(ErrorCode.INVALID_LINK_NAME, "fk_link_names is empty; name at least one link")
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            code = self._context.reporter.failure("fk", error)
            response = GetPositionFKResponse()
            response.error_code.val = code
            return response
        response.error_code.val = ErrorCode.SUCCESS
        return response
