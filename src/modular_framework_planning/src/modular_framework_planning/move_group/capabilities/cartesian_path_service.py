# SPDX-License-Identifier: BSD-3-Clause
"""Service compute_cartesian_path: a timed path of straight lines through waypoints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import rospy
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathResponse

from modular_framework_planning.cartesian.cartesian_path import (
    JumpThresholds,
    StepCheck,
    StraightLine,
    accept_step,
    collision_check,
    straight_line,
)
from modular_framework_planning.constraints.robot_frames import frame_on_robot, require_holding_link
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.messages.constraint_conversions import constraints_from_message
from modular_framework_planning.messages.conversions import scene_with_state, state_message, trajectory_message
from modular_framework_planning.messages.multi_dof import names_joints
from modular_framework_planning.messages.poses import transform_from_pose
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.move_group.capabilities.capability import ServiceCapability
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.line_timing import time_line
from modular_framework_planning.trajectory_processing.link_speed import MovedFrame, with_limited_link_speed
from modular_framework_planning.trajectory_processing.trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Lines:
    """A parsed request; `follower` moves along the lines, and `offset` is its pose in the frame of `link`."""

    scene: PlanningScene
    group: JointGroup
    solver: InverseKinematics
    follower: str
    link: str
    offset: Transform
    waypoints: tuple[Transform, ...]
    motion: MotionChecker
    checker: CollisionChecker | None


class CartesianPathService(ServiceCapability):
    """Offers compute_cartesian_path (moveit_msgs/GetCartesianPath).

    As in MoveIt, the response is a success with the planned fraction even if the path ends early; the log and
    ~planning_report then name the waypoint, the step and the reason. Waypoints in the frame of the moved link are
    relative to the previous waypoint.
    """

    name, kind = names.CARTESIAN_PATH_SERVICE, GetCartesianPath

    def _serve(self, request: Any) -> GetCartesianPathResponse:
        response = GetCartesianPathResponse()
        details: dict[str, Any] = {"group": request.group_name, "fraction": 0.0}
        try:
            lines = self._read(request)
            path = straight_line(
                PoseFollower(lines.solver, lines.link, lines.scene.positions),
                lines.waypoints,
                request.max_step,
                jumps=JumpThresholds(
                    request.jump_threshold, request.prismatic_jump_threshold, request.revolute_jump_threshold
                ),
                check_step=self._step_check(lines, request),
                carried=lines.offset,
            )
            trajectory = self._timed_trajectory(lines, path, request)
        except Exception as error:  # noqa: BLE001 - one bad request must not take the node down; the reporter logs it
            response.error_code.val = self._context.reporter.failure("cartesian_path", error, **details)
            return response
        response.start_state = state_message(lines.scene)
        response.solution = trajectory_message(trajectory, lines.scene.model)
        response.fraction = path.fraction
        response.error_code.val = ErrorCode.SUCCESS
        if path.stop:
            rospy.logwarn("cartesian_path: %.1f %% of the path was planned, until %s", 100.0 * path.fraction, path.stop)
        self._context.reporter.report(
            "cartesian_path",
            ErrorCode.SUCCESS,
            path.stop,
            **{**details, "fraction": path.fraction, "points": len(trajectory.times)},
        )
        return response

    def _read(self, request: Any) -> _Lines:
        """Reads the message; raises PlanningError."""
        group = self._context.model.group(request.group_name)
        solver = self._context.kinematics.solver(group.name)
        if not names_joints(request.start_state) or request.start_state.is_diff:
            self._context.monitor.wait_for_state()
        scene = scene_with_state(self._context.monitor.snapshot(), request.start_state, "start_state")
        name = (request.link_name or group.tip_link).removeprefix("/")
        link = require_holding_link(scene, name, "link_name")
        offset = scene.frame_transform(link).actInv(scene.frame_transform(name))
        checker = None
        if request.avoid_collisions:
            checker = self._context.pipeline("").checker(scene, group, scene.positions)
        motion_checker = checker or self._context.new_checker(scene, group.indices)
        motion = MotionChecker(motion_checker, group.indices, scene.positions)
        return _Lines(
            scene=scene,
            group=group,
            solver=solver,
            follower=name,
            link=link,
            offset=offset,
            waypoints=_waypoints(scene, name, request),
            motion=motion,
            checker=checker,
        )

    def _step_check(self, lines: _Lines, request: Any) -> StepCheck:
        """Returns a check of a step that finds violated path constraints, then collisions."""
        constraints = constraints_from_message(
            lines.scene, request.path_constraints, "path_constraints", tip=lines.link
        )
        collides = accept_step
        if lines.checker is not None:
            collides = collision_check(lines.checker, lines.motion, self._context.pipeline("").settings.motion_step)

        def check_step(before: Array, after: Array) -> str:
            if not constraints.is_empty and not constraints.are_satisfied(lines.motion.full_positions(after)):
                return f"path_constraints: {constraints.describe(lines.motion.full_positions(after))}"
            return collides(before, after)

        return check_step

    def _timed_trajectory(self, lines: _Lines, path: StraightLine, request: Any) -> Trajectory:
        model, indices = lines.scene.model, lines.group.indices
        velocity, acceleration = model.max_velocity[indices], model.max_acceleration[indices]
        step = self._context.pipeline("").settings.motion_step

        def is_free(curve: Array) -> bool:
            moves = lines.checker is not None and len(path.rows) > 1
            return not moves or lines.motion.colliding_state(curve, step) is None

        trajectory = time_line(lines.group.joints, path.rows, velocity, acceleration, is_free)
        if request.max_cartesian_speed <= 0.0:
            return trajectory
        name = request.cartesian_speed_limited_link or lines.follower
        require_holding_link(lines.scene, name, "cartesian_speed_limited_link")
        frame = MovedFrame(model, frame_on_robot(lines.scene, name), lines.motion.full_positions)
        return with_limited_link_speed(trajectory, frame, request.max_cartesian_speed, velocity, acceleration)


def _waypoints(scene: PlanningScene, follower: str, request: Any) -> tuple[Transform, ...]:
    """Returns the waypoints in the planning frame.

    Args:
        scene: Planning scene.
        follower: Link or held object that follows the lines.
        request: Request message.

    Raises:
        PlanningError: A number is not finite, or a frame is unknown.
    """
    if not math.isfinite(request.max_cartesian_speed):
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"max_cartesian_speed is {request.max_cartesian_speed}; give a finite number, or 0 for no limit",
        )
    poses = [transform_from_pose(pose, f"waypoints[{index}]") for index, pose in enumerate(request.waypoints)]
    frame = request.header.frame_id.removeprefix("/")
    base = scene.frame_transform(frame)
    if frame != follower:
        return tuple(base * pose for pose in poses)
    result = []
    for pose in poses:
        base = base * pose
        result.append(base)
    return tuple(result)
