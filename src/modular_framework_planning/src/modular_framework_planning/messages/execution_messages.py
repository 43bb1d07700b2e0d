# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of a planned trajectory into goals of single controllers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from control_msgs.msg import FollowJointTrajectoryGoal, GripperCommandGoal, JointTolerance
from genpy import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.trajectory_execution.controllers import ControllerSpec


@dataclass(frozen=True, slots=True)
class MotionPart:
    """Part of a motion for a single controller."""

    controller: ControllerSpec
    trajectory: JointTrajectory

    @property
    def duration_s(self) -> float:
        """Time of the last point [s]."""
        return float(self.trajectory.points[-1].time_from_start.to_sec())


def check_trajectory(motion: JointTrajectory) -> None:
    """Checks that a trajectory is well-formed; raises PlanningError."""
    count = len(motion.joint_names)
    if motion.points and not count:
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"trajectory: {len(motion.points)} points, but joint_names is empty; name the joint of each position",
        )
    previous_s = -1.0
    for index, point in enumerate(motion.points):
        time_s = point.time_from_start.to_sec()
        if len(point.positions) != count or not np.isfinite(point.positions).all():
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"trajectory point {index}: {len(point.positions)} positions for {count} joints; "
                "give one finite position per joint",
            )
        if time_s <= previous_s:
            raise PlanningError(
                ErrorCode.INVALID_MOTION_PLAN,
                f"trajectory point {index} at {time_s} s does not come "
                f"after the previous point at {previous_s} s; times must strictly increase",
            )
        previous_s = time_s


def split(motion: JointTrajectory, controllers: Sequence[ControllerSpec]) -> list[MotionPart]:
    """Returns the part of the motion for each controller; joints without a controller are left out."""
    parts = []
    for spec in controllers:
        columns = [i for i, joint in enumerate(motion.joint_names) if joint in spec.joints]
        if columns:
            parts.append(MotionPart(spec, _columns(motion, columns)))
    return parts


def _columns(motion: JointTrajectory, columns: Collection[int]) -> JointTrajectory:
    part = JointTrajectory(header=motion.header, joint_names=[motion.joint_names[i] for i in columns])
    for point in motion.points:
        part.points.append(
            JointTrajectoryPoint(
                *(
                    [values[i] for i in columns] if values else []
                    for values in (point.positions, point.velocities, point.accelerations, point.effort)
                ),
                point.time_from_start,
            )
        )
    return part


def at_speed(motion: JointTrajectory, factor: float) -> JointTrajectory:
    """Returns the motion at `factor` times its speed."""
    if factor == 1.0:
        return motion
    faster = JointTrajectory(header=motion.header, joint_names=motion.joint_names)
    for point in motion.points:
        faster.points.append(
            JointTrajectoryPoint(
                point.positions,
                [value * factor for value in point.velocities],
                [value * factor**2 for value in point.accelerations],
                point.effort,
                Duration.from_sec(point.time_from_start.to_sec() / factor),
            )
        )
    return faster


def trajectory_goal(part: MotionPart) -> FollowJointTrajectoryGoal:
    """Returns the goal for a trajectory controller, with the controller's configured tolerances."""
    spec = part.controller
    joints = set(part.trajectory.joint_names)
    goal = FollowJointTrajectoryGoal(trajectory=part.trajectory)
    goal.path_tolerance, goal.goal_tolerance = (
        [
            JointTolerance(item.joint, item.position, item.velocity, item.acceleration)
            for item in items
            if item.joint in joints
        ]
        for items in (spec.path_tolerances, spec.goal_tolerances)
    )
    goal.goal_time_tolerance = Duration.from_sec(spec.goal_time_tolerance)
    return goal


def gripper_goal(part: MotionPart) -> GripperCommandGoal:
    """Returns the goal for a gripper: position and effort of the last point, or else the configured effort."""
    names, last = part.trajectory.joint_names, part.trajectory.points[-1]
    columns = [i for i, name in enumerate(names) if name in part.controller.command_joints] or [0]
    goal: Any = GripperCommandGoal()
    goal.command.position = sum(last.positions[i] for i in columns)
    goal.command.max_effort = last.effort[columns[-1]] if last.effort else part.controller.max_effort
    return goal
