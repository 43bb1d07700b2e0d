# SPDX-License-Identifier: BSD-3-Clause
"""Retimes a RobotTrajectory, whose joints and planar or floating base are timed together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Twist, Vector3
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from moveit_commander.exception import MoveItCommanderException
from moveit_commander.joints import Joint
from moveit_commander.robot_model import RobotModel
from moveit_commander.robot_state import PLANAR, base_values
from moveit_commander.trajectory_timing import Limits, Timing, distinct, retime, unwound


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """Waypoints of a trajectory.

    Attributes:
        variables: Variables of the joints, and then of a planar or floating base.
        rows: Positions, shape (n, variables) [rad or m]; continuous joints and quaternions never jump.
        joint_count: Number of joints before the variables of the base.
    """

    variables: tuple[Joint, ...]
    rows: Any
    joint_count: int


def retimed_trajectory(
    model: RobotModel, trajectory: RobotTrajectory, velocity_factor: float, acceleration_factor: float
) -> RobotTrajectory:
    """Returns the trajectory with the same waypoints but new times, velocities and accelerations.

    Args:
        model: Robot model.
        trajectory: Trajectory; repeated points are removed.
        velocity_factor: Fraction of the maximum velocities, in (0, 1].
        acceleration_factor: Fraction of the maximum accelerations, in (0, 1].

    Raises:
        MoveItCommanderException: A joint is unknown, the positions of a point are not one finite number per joint, the
            base and the other joints have different numbers of points, or a limit is not above 0.
    """
    waypoints = _read_waypoints(model, trajectory)
    kept = distinct(waypoints.rows).tolist() if len(waypoints.rows) > 1 else list(range(len(waypoints.rows)))
    rows = waypoints.rows[kept]
    if len(rows) < 2:
        timing = Timing(np.zeros(len(rows)), np.zeros_like(rows), np.zeros_like(rows))
        return _with_timing(trajectory, waypoints, kept, timing, model)
    lower, upper, velocity, acceleration = np.array(
        [(item.lower, item.upper, item.velocity, item.acceleration) for item in waypoints.variables]
    ).T
    is_endless = [item.kind == "continuous" for item in waypoints.variables]
    limits = Limits(
        np.where(is_endless, -np.inf, lower),
        np.where(is_endless, np.inf, upper),
        velocity_factor * velocity,
        acceleration_factor * acceleration,
    )
    return _with_timing(trajectory, waypoints, kept, retime(rows, limits), model)


def _read_waypoints(model: RobotModel, trajectory: RobotTrajectory) -> Waypoints:
    joints, rows = _joint_rows(model, trajectory)
    base_points = trajectory.multi_dof_joint_trajectory.points
    base = _base_rows(model, trajectory) if base_points else np.empty((len(rows), 0))
    if not trajectory.joint_trajectory.points:
        joints, rows = (), np.empty((len(base), 0))
    if len(rows) != len(base):
        raise MoveItCommanderException(
            f"retime_trajectory: joint_trajectory has {len(rows)} points, multi_dof_joint_trajectory {len(base)}; both "
            "need the same points"
        )
    variables = (*joints, *(model.base_variables if base_points else ()))
    rows = np.hstack([rows, base])
    rows = unwound(rows, [variable.kind == "continuous" for variable in variables]) if len(rows) else rows
    return Waypoints(variables, rows, len(joints))


def _joint_rows(model: RobotModel, trajectory: RobotTrajectory) -> tuple[tuple[Joint, ...], Any]:
    names = trajectory.joint_trajectory.joint_names
    unknown = [name for name in names if name not in model.joints]
    if unknown:
        raise MoveItCommanderException(
            f"retime_trajectory: unknown joints {unknown}; only joints of the robot are "
            f"allowed: {', '.join(model.joints)}"
        )
    points = [point.positions for point in trajectory.joint_trajectory.points]
    for number, point in enumerate(points):
        if len(point) != len(names) or not np.isfinite(point).all():
            raise MoveItCommanderException(
                f"retime_trajectory: points[{number}] has positions {list(point)}; one finite number is needed "
                f"for each of the {len(names)} joints"
            )
    return tuple(model.joints[name] for name in names), np.array(points, dtype=float).reshape(len(points), len(names))


def _base_rows(model: RobotModel, trajectory: RobotTrajectory) -> Any:
    """Returns the variables of the base, with quaternions of length 1 that do not change their sign."""
    names = list(trajectory.multi_dof_joint_trajectory.joint_names)
    known = [model.base.name] if model.base else []
    if names != known:
        raise MoveItCommanderException(
            f"retime_trajectory: multi_dof_joint_trajectory names the joints {names}; allowed: {known}"
        )
    rows = []
    for number, point in enumerate(trajectory.multi_dof_joint_trajectory.points):
        values = list(base_values(model, point.transforms[0]).values()) if len(point.transforms) == 1 else []
        if not values or not np.isfinite(values).all():
            raise MoveItCommanderException(
                f"retime_trajectory: multi_dof_joint_trajectory.points[{number}] needs one transform of finite numbers"
            )
        rows.append(values)
    array = np.array(rows)
    if array.shape[1] > 3:  # a floating base ends with its quaternion
        quaternions = array[:, 3:] / np.maximum(np.linalg.norm(array[:, 3:], axis=1, keepdims=True), 1e-9)
        turned = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
        signs = np.cumprod(np.concatenate([[1.0], np.where(turned, -1.0, 1.0)]))
        array[:, 3:] = quaternions * signs[:, None]
    return array


def _with_timing(
    trajectory: RobotTrajectory, waypoints: Waypoints, kept: Sequence[int], timing: Timing, model: RobotModel
) -> RobotTrajectory:
    """Returns the trajectory with the kept waypoints and new times, velocities and accelerations.

    Args:
        trajectory: Original trajectory.
        waypoints: Its waypoints.
        kept: Indices of the waypoints of the timing.
        timing: Times, velocities and accelerations of all variables.
        model: Robot model.
    """
    result, count = RobotTrajectory(), waypoints.joint_count
    result.joint_trajectory.header = trajectory.joint_trajectory.header
    result.joint_trajectory.joint_names = list(trajectory.joint_trajectory.joint_names)
    multi = result.multi_dof_joint_trajectory
    multi.header = trajectory.multi_dof_joint_trajectory.header
    multi.joint_names = list(trajectory.multi_dof_joint_trajectory.joint_names)
    for number, index in enumerate(kept):
        row, time = waypoints.rows[index], rospy.Duration.from_sec(float(timing.times[number]))
        velocity, acceleration = timing.velocities[number], timing.accelerations[number]
        if count:
            positions, velocities, accelerations = (values[:count].tolist() for values in (row, velocity, acceleration))
            effort: list[float] = []
            result.joint_trajectory.points.append(
                JointTrajectoryPoint(positions, velocities, accelerations, effort, time)
            )
        if len(row) > count:
            twists = [[_twist(model, row[count:], rates[count:])] for rates in (velocity, acceleration)]
            transforms = trajectory.multi_dof_joint_trajectory.points[index].transforms
            multi.points.append(MultiDOFJointTrajectoryPoint(transforms, *twists, time))
    return result


def _twist(model: RobotModel, values: Any, rates: Any) -> Twist:
    """Returns the velocity of the base in its parent frame; with second derivatives as rates, its acceleration.

    The angular velocity of a quaternion q is the vector part of 2 q' q*. The angular acceleration is the vector part of
    2 q'' q*, because q' q'* is a real number.

    Args:
        model: Robot model.
        values: Variables of the base, shape (variables,) [rad or m].
        rates: First or second derivatives of the variables.
    """
    if model.base is not None and model.base.kind == PLANAR:
        x, y, heading = rates.tolist()
        return Twist(Vector3(x, y, 0.0), Vector3(0.0, 0.0, heading))
    vector, real, vector_rate, real_rate = values[3:6], values[6], rates[3:6], rates[6]
    angular = 2.0 * (real * vector_rate - real_rate * vector - np.cross(vector_rate, vector))
    return Twist(Vector3(*rates[:3].tolist()), Vector3(*angular.tolist()))
