# SPDX-License-Identifier: BSD-3-Clause
"""Converts a planar or floating base between messages (one transform) and position vectors (its variables)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import genpy
from geometry_msgs.msg import Transform as TransformMessage
from geometry_msgs.msg import Twist, Vector3
from moveit_msgs.msg import JointConstraint, RobotState
from sensor_msgs.msg import MultiDOFJointState
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, GeometryError, PlanningError, UnknownNameError
from modular_framework_planning.geometry.spatial import Array, Transform, make_transform, quaternion_or_identity
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory


def names_joints(state: RobotState) -> bool:
    """Whether a state gives the position of any joint."""
    return bool(state.joint_state.name or state.multi_dof_joint_state.joint_names)


def transform_of(message: TransformMessage, where: str) -> Transform:
    """Reads a transform; one whose rotation is not filled in has none. Raises GeometryError."""
    t, q = message.translation, message.rotation
    return make_transform((t.x, t.y, t.z), quaternion_or_identity((q.x, q.y, q.z, q.w), where), where)


def transform_message(transform: Transform) -> TransformMessage:
    """Writes a transform."""
    pose = pose_message(transform)
    message = TransformMessage(rotation=pose.orientation)
    message.translation.x, message.translation.y, message.translation.z = (
        pose.position.x,
        pose.position.y,
        pose.position.z,
    )
    return message


def with_multi_dof(scene: PlanningScene, state: MultiDOFJointState, where: str) -> PlanningScene:
    """Returns the scene with the base where a message puts it; a fixed joint that is named changes nothing.

    Args:
        scene: gives the header's frame its pose; an empty one is the planning frame.
        state: transforms of joints.
        where: what the message belongs to, for error texts.

    Raises:
        PlanningError: numbers of names and transforms differ, a joint does not exist or has one variable only, a
            transform is none, or the frame is not known.
    """
    if len(state.joint_names) != len(state.transforms):
        raise PlanningError(
            ErrorCode.INVALID_ROBOT_STATE,
            f"{where}: multi_dof_joint_state with {len(state.joint_names)} joint names and {len(state.transforms)} "
            "transforms; one transform per name is needed",
        )
    model = scene.model
    for name, message in zip(state.joint_names, state.transforms, strict=True):
        if model.base is not None and name == model.base.name:
            frame = scene.frame_transform(state.header.frame_id)
            transform = frame * transform_of(message, f"{where}: multi_dof_joint_state '{name}'")
            scene = scene.with_positions(model.with_base(scene.positions, transform))
        elif not _is_fixed(model, name):
            raise UnknownNameError(
                ErrorCode.INVALID_ROBOT_STATE,
                f"{where}: multi_dof_joint_state: planar or floating joint",
                name,
                [model.base.name] if model.base else [],
            )
    return scene


def _is_fixed(model: RobotModel, name: str) -> bool:
    """Whether a fixed joint of the URDF or SRDF has that name."""
    virtual = (joint.name for joint in model.semantics.virtual_joints)
    return model.document.joint_kinds.get(name) == "fixed" or name in virtual


def with_angles(scene: PlanningScene, constraints: Sequence[Any], where: str, code: ErrorCode) -> list[Any]:
    """Replaces joint constraints on the quaternion of a floating base by ones on its angles.

    Args:
        scene: its present angles decide between equal ones.
        constraints: moveit_msgs/JointConstraint, as MoveIt's clients write them from a state.
        where: what they belong to, for error texts.
        code: result code for constraints that have no meaning.

    Raises:
        PlanningError: some of the quaternion's four numbers are missing, or it is none.
    """
    base, model = scene.model.base, scene.model
    given = {item.joint_name: item for item in constraints if base is not None and item.joint_name in base.quaternion}
    if base is None or not given:
        return list(constraints)
    if len(given) != len(base.quaternion):
        raise PlanningError(
            code,
            f"{where}: joint constraints on {', '.join(given)} alone; give all of {', '.join(base.quaternion)}, or "
            f"{', '.join(base.angles)} [rad]",
        )
    try:
        turn = make_transform((0.0, 0.0, 0.0), [given[name].position for name in base.quaternion], where)
    except GeometryError as error:
        raise PlanningError(code, error.reason) from error
    values = base.values(turn, scene.positions[model.base_indices])
    slack = 2.0 * min(min(item.tolerance_above, item.tolerance_below) for item in given.values())  # half angles
    angles = [
        JointConstraint(name, float(value), slack, slack, 1.0)
        for name, value in zip(base.variables, values, strict=True)
        if name in base.angles
    ]
    return [item for item in constraints if item.joint_name not in given] + angles


def goal_values(model: RobotModel, joints: Sequence[str], positions: Array) -> dict[str, float]:
    """Returns a goal by joint as every move_group reads it: the rotation of a floating base as a quaternion.

    Args:
        model: the robot.
        joints: of the group.
        positions: of the whole robot [rad or m].
    """
    goal = {name: float(positions[model.index[name]]) for name in joints}
    base = model.base
    if base is None or not base.quaternion or base.variables[0] not in goal:
        return goal
    turn = pose_message(model.base_transform(positions)).orientation
    numbers = dict(zip(base.quaternion, (turn.x, turn.y, turn.z, turn.w), strict=True))
    return {name: value for name, value in goal.items() if name not in base.angles} | numbers


def multi_dof_message(model: RobotModel, positions: Array) -> MultiDOFJointState:
    """Writes where the base is in the planning frame; without names where the robot has a fixed base."""
    message = MultiDOFJointState()
    message.header.frame_id = model.planning_frame
    if model.base is not None:
        message.joint_names = [model.base.name]
        message.transforms = [transform_message(model.base_transform(positions))]
    return message


def single_joints(model: RobotModel, names: Sequence[str]) -> list[int]:
    """Returns the columns of joints with one variable of their own; those of the base are left out."""
    base = frozenset(model.base.variables if model.base else ())
    return [number for number, name in enumerate(names) if name not in base]


def multi_dof_trajectory(model: RobotModel, trajectory: Trajectory) -> MultiDOFJointTrajectory:
    """Writes the motion of the base: its poses, velocities and accelerations in the planning frame.

    It has no points where the base does not belong to the trajectory's joints.
    """
    message = MultiDOFJointTrajectory()
    message.header.frame_id = model.planning_frame
    names = list(trajectory.joint_names)
    if model.base is None or model.base.variables[0] not in names:
        return message
    columns = [names.index(name) for name in model.base.variables]
    message.joint_names = [model.base.name]
    for number, stamp in enumerate(trajectory.times):
        values, rates, changes = (
            rows[number, columns] for rows in (trajectory.positions, trajectory.velocities, trajectory.accelerations)
        )
        velocity, acceleration = model.base.twists(values, rates, changes)
        message.points.append(
            MultiDOFJointTrajectoryPoint(
                transforms=[transform_message(model.base.transform(values))],
                velocities=[_twist(velocity)],
                accelerations=[_twist(acceleration)],
                time_from_start=genpy.Duration.from_sec(float(stamp)),
            )
        )
    return message


def _twist(values: Array) -> Twist:
    return Twist(Vector3(*values[:3].tolist()), Vector3(*values[3:].tolist()))
