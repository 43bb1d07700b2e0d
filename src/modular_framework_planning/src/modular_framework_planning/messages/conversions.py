# SPDX-License-Identifier: BSD-3-Clause
"""Conversions of states, goals and trajectories between messages and the planner's own types."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import genpy
import numpy as np
from moveit_msgs.msg import RobotState, RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.constraints.robot_frames import holding_link
from modular_framework_planning.contacts import ATTACHED, LINK, WORLD
from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.messages.constraint_conversions import constraints_from_message
from modular_framework_planning.messages.multi_dof import (
    multi_dof_message,
    multi_dof_trajectory,
    names_joints,
    single_joints,
    with_multi_dof,
)
from modular_framework_planning.messages.scene_conversions import apply_attached_object, attached_to_message
from modular_framework_planning.planning_interface.planning_request import ConstraintGoal, JointGoal, PoseGoal
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

LOGGER = logging.getLogger("rosout.goals")
BODY_TYPES = {LINK: 0, WORLD: 1, ATTACHED: 2}


def joint_values(
    model: RobotModel, names: Sequence[str], positions: Sequence[float], field_name: str
) -> dict[str, float]:
    """Returns positions by joint name, without fixed joints.

    Args:
        model: Robot model.
        names: Joint names.
        positions: Position of each joint [rad or m].
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The lengths differ, a joint is unknown, or a value is not finite.
    """
    if len(names) != len(positions):
        raise PlanningError(
            ErrorCode.INVALID_ROBOT_STATE,
            f"{field_name}: {len(names)} joint names and {len(positions)} positions; give one position per name",
        )
    values = {}
    for name, position in zip(names, positions, strict=True):
        if name not in model.index:
            if model.document.joint_kinds.get(name) == "fixed":
                continue
            raise UnknownNameError(ErrorCode.INVALID_ROBOT_STATE, f"{field_name}: joint", name, model.joint_names)
        if not np.isfinite(position):
            raise PlanningError(
                ErrorCode.INVALID_ROBOT_STATE, f"{field_name}: joint '{name}' is {position}; give a finite number"
            )
        values[name] = float(position)
    return values


def scene_with_state(scene: PlanningScene, state: RobotState, field_name: str = "robot state") -> PlanningScene:
    """Returns the scene with the robot in the state of a message.

    Unnamed joints and an unnamed planar or floating base keep their positions. A state that names joints and is not a
    diff replaces the attached objects; any other state adds its attached objects.

    Args:
        scene: Scene.
        state: State message.
        field_name: Name of the message field, for error messages.
    """
    if names_joints(state):
        values = joint_values(scene.model, state.joint_state.name, state.joint_state.position, field_name)
        scene = scene.with_positions(scene.model.merge(scene.positions, values))
        scene = with_multi_dof(scene, state.multi_dof_joint_state, field_name)
        if not state.is_diff:
            scene = scene.without_attached(scene.attached)
    for item in state.attached_collision_objects:
        scene = apply_attached_object(scene, item)
    return scene


def state_message(
    scene: PlanningScene, positions: Array | None = None, with_attached: bool = True, with_geometry: bool = True
) -> RobotState:
    """Returns a state message with joint positions, base pose and attached objects.

    Args:
        scene: Scene.
        positions: Joint positions of the whole robot [rad or m]; None for the scene's positions.
        with_attached: Whether attached objects are included.
        with_geometry: Whether the shapes of attached objects are included.
    """
    message, model = RobotState(), scene.model
    values = scene.positions if positions is None else positions
    message.joint_state.header.frame_id = model.planning_frame
    for index in single_joints(model, model.joint_names):
        message.joint_state.name.append(model.joint_names[index])
        message.joint_state.position.append(float(values[index]))
    message.multi_dof_joint_state = multi_dof_message(model, values)
    if with_attached:
        message.attached_collision_objects = [
            attached_to_message(scene, item, with_geometry) for item in scene.attached.values()
        ]
    return message


def goals_from_constraints(
    scene: PlanningScene, constraints: Sequence[Any], tip: str
) -> tuple[JointGoal | PoseGoal | ConstraintGoal, ...]:
    """Reads goal_constraints, a list of alternatives.

    Args:
        scene: Scene.
        constraints: Messages of type moveit_msgs/Constraints.
        tip: Link for constraints without a link_name.

    Raises:
        PlanningError: An entry is empty or invalid.
    """
    return tuple(_goal(scene, item, tip, f"goal_constraints[{index}]") for index, item in enumerate(constraints))


def _goal(scene: PlanningScene, item: Any, tip: str, field_name: str) -> JointGoal | PoseGoal | ConstraintGoal:
    constraints = constraints_from_message(scene, item, field_name, ErrorCode.INVALID_GOAL_CONSTRAINTS, tip)
    if constraints.is_empty:
        raise PlanningError(
            ErrorCode.INVALID_GOAL_CONSTRAINTS,
            f"{field_name}: no constraint; give joint, position or orientation constraints",
        )
    constraints = _without_passive_joints(scene, constraints, field_name)
    joints = constraints.joints
    if len({joint.name for joint in joints}) == len(joints) and not (constraints.positions or constraints.orientations):
        return JointGoal(
            {joint.name: joint.target for joint in joints},
            {joint.name: joint.below for joint in joints},
            {joint.name: joint.above for joint in joints},
        )
    name = constraints.pose_link
    if not name:
        return ConstraintGoal(constraints)
    link = holding_link(scene, name)
    in_link = scene.frame_transform(link).actInv(scene.frame_transform(name))
    target = constraints.pose_target(scene.positions) * in_link.inverse()
    return PoseGoal(link, target, constraints, None if name == link else in_link)


def _without_passive_joints(
    scene: PlanningScene, constraints: KinematicConstraints, field_name: str
) -> KinematicConstraints:
    """Returns the constraints without passive joints; a violated constraint on a passive joint is logged."""
    passive = [item for item in constraints.joints if item.name in scene.model.passive_joints]
    for item in passive:
        result = item.evaluate(scene.positions)
        if not result.satisfied:
            LOGGER.warning("%s: %s; the joint is passive and stays there", field_name, result.text)
    if not passive:
        return constraints
    active = [item for item in constraints.joints if item not in passive]
    return KinematicConstraints(scene.model, active, constraints.positions, constraints.orientations, constraints.name)


def refuse_constraints(field_name: str, constraints: Any, code: ErrorCode) -> None:
    """Raises PlanningError if constraints are given where they are not supported.

    Args:
        field_name: Name of the message field, for error messages.
        constraints: moveit_msgs/Constraints.
        code: Error code.
    """
    if any(
        (
            constraints.joint_constraints,
            constraints.position_constraints,
            constraints.orientation_constraints,
            constraints.visibility_constraints,
        )
    ):
        raise PlanningError(code, f"{field_name}: constraints are not supported here; leave them empty")


def trajectory_message(trajectory: Trajectory, model: RobotModel) -> RobotTrajectory:
    """Returns a trajectory message; the motion of a planar or floating base is a multi-DOF trajectory."""
    message = RobotTrajectory()
    message.joint_trajectory.header.frame_id = model.planning_frame
    message.multi_dof_joint_trajectory = multi_dof_trajectory(model, trajectory)
    columns = single_joints(model, trajectory.joint_names)
    message.joint_trajectory.joint_names = [trajectory.joint_names[column] for column in columns]
    if not columns:
        return message
    message.joint_trajectory.points = [
        JointTrajectoryPoint(
            positions=row.tolist(),
            velocities=velocity.tolist(),
            accelerations=acceleration.tolist(),
            time_from_start=genpy.Duration.from_sec(float(time)),
        )
        for time, row, velocity, acceleration in zip(
            trajectory.times,
            trajectory.positions[:, columns],
            trajectory.velocities[:, columns],
            trajectory.accelerations[:, columns],
            strict=True,
        )
    ]
    return message
