# SPDX-License-Identifier: BSD-3-Clause
"""Converts between ROS messages and the types of the controllers.

Messages carry ROS time, controllers use the time of the control loop: ROS time is ahead by `ahead_s` [s] (see
`LoopTime`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import genpy
from control_msgs.msg import (
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandFeedback,
    GripperCommandResult,
)
from controller_manager_msgs.msg import ControllerState, ControllerStatistics, HardwareInterfaceResources
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_control.controller_manager.controller_manager import ControllerReport
from modular_framework_control.controller_manager.controller_switch import ControllerState as LoadedState
from modular_framework_control.controllers.gripper_action_controller import GripperState
from modular_framework_control.controllers.joint_state_controller import JointStateSnapshot
from modular_framework_control.ros.trajectory_messages import CompactJointTrajectory
from modular_framework_control.trajectory.joint_trajectory import Array, JointTrajectory
from modular_framework_control.trajectory.tolerances import JointTolerance
from modular_framework_control.trajectory.trajectory_goal import TrajectoryErrorCode, TrajectoryGoal, TrajectorySnapshot


def trajectory_from_msg(message: CompactJointTrajectory, ahead_s: float = 0.0) -> JointTrajectory:
    """Returns a trajectory from its message, without checks."""
    stamp = message.header.stamp
    return JointTrajectory(tuple(message.joint_names), message.points, stamp.to_sec() - ahead_s if stamp else 0.0)


def _tolerances_from_msg(messages: Sequence[Any]) -> dict[str, JointTolerance]:
    return {message.name: JointTolerance(message.position, message.velocity) for message in messages}


def goal_from_msg(message: FollowJointTrajectoryGoal, ahead_s: float = 0.0) -> TrajectoryGoal:
    """Returns a trajectory goal from the message of a CompactTrajectoryActionGoal, without checks."""
    return TrajectoryGoal(
        trajectory_from_msg(message.trajectory, ahead_s),
        _tolerances_from_msg(message.path_tolerance),
        _tolerances_from_msg(message.goal_tolerance),
        message.goal_time_tolerance.to_sec(),
    )


def trajectory_result_to_msg(code: TrajectoryErrorCode, text: str) -> FollowJointTrajectoryResult:
    """Returns the result message of a trajectory goal."""
    return FollowJointTrajectoryResult(error_code=int(code), error_string=text)


def _point(state: Array) -> JointTrajectoryPoint:
    rows = [row.tolist() for row in state]
    return JointTrajectoryPoint(positions=rows[0], velocities=rows[1], accelerations=rows[2] if len(rows) > 2 else [])


def fill_snapshot(message: Any, snapshot: TrajectorySnapshot, joint_names: Sequence[str], ahead_s: float = 0.0) -> Any:
    """Writes a snapshot into a message, and returns the message.

    Args:
        message: Message of type JointTrajectoryControllerState or FollowJointTrajectoryFeedback.
        snapshot: State of a trajectory controller.
        joint_names: Joints of the controller.
        ahead_s: Offset of the stamp from the time of the loop [s].
    """
    message.header.stamp = genpy.Time.from_sec(snapshot.time_s + ahead_s)
    message.joint_names = list(joint_names)
    message.desired = _point(snapshot.desired)
    message.actual = _point(snapshot.actual)
    message.error = _point(snapshot.error)
    message.desired.time_from_start = message.actual.time_from_start = genpy.Duration.from_sec(snapshot.elapsed_s)
    return message


def gripper_result_to_msg(state: GripperState) -> GripperCommandResult:
    """Returns the result message of a gripper goal."""
    return GripperCommandResult(state.position, state.effort, state.stalled, state.reached_goal)


def gripper_feedback_to_msg(state: GripperState) -> GripperCommandFeedback:
    """Returns the feedback message of a gripper goal."""
    return GripperCommandFeedback(state.position, state.effort, state.stalled, state.reached_goal)


def joint_state_to_msg(snapshot: JointStateSnapshot, ahead_s: float = 0.0) -> JointState:
    """Returns joint states as a sensor_msgs/JointState."""
    message = JointState(
        name=snapshot.names, position=snapshot.positions, velocity=snapshot.velocities, effort=snapshot.efforts
    )
    message.header.stamp = genpy.Time.from_sec(snapshot.time_s + ahead_s)
    return message


def controller_report_to_msg(report: ControllerReport) -> ControllerState:
    """Returns an entry of list_controllers; interfaces have their C++ names in the message."""
    claims = [
        HardwareInterfaceResources(claim.hardware_interface.replace("/", "::"), list(claim.resources))
        for claim in report.info.claimed_resources
    ]
    return ControllerState(report.info.name, report.state.value, report.info.type, claims)


def controller_statistics_to_msg(report: ControllerReport, ahead_s: float = 0.0) -> ControllerStatistics:
    """Returns the update times of a controller; the duration `variance_time` is the root of their variance."""
    figures = report.statistics
    updated, overrun = (
        genpy.Time.from_sec(time_s + ahead_s if time_s else 0.0)
        for time_s in (figures.updated_at_s, figures.last_overrun_s)
    )
    return ControllerStatistics(
        name=report.info.name,
        type=report.info.type,
        timestamp=updated,
        running=report.state is LoadedState.RUNNING,
        max_time=genpy.Duration.from_sec(figures.max_s),
        mean_time=genpy.Duration.from_sec(figures.mean_s),
        variance_time=genpy.Duration.from_sec(math.sqrt(figures.variance_s2)),
        num_control_loop_overruns=figures.overruns,
        time_last_control_loop_overrun=overrun,
    )
