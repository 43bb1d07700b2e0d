# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of a planar or floating base between messages (a transform) and position vectors (variables)."""

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
    """Returns whether a state has a position of any joint."""
    return bool(state.joint_state.name or state.multi_dof_joint_state.joint_names)


def transform_of(message: TransformMessage, field_name: str) -> Transform:
    """Reads a transform; an unset rotation is the identity. Raises GeometryError."""
    t, q = message.translation, message.rotation
    return make_transform((t.x, t.y, t.z), quaternion_or_identity((q.x, q.y, q.z, q.w), field_name), field_name)


def transform_message(transform: Transform) -> TransformMessage:
    """Returns a transform as a message."""
    pose = pose_message(transform)
    message = TransformMessage(rotation=pose.orientation)
    message.translation.x, message.translation.y, message.translation.z = (
        pose.position.x,
        pose.position.y,
        pose.position.z,
    )
    return message


def with_multi_dof(scene: PlanningScene, state: MultiDOFJointState, field_name: str) -> PlanningScene:
    """Returns the scene with the base at the pose in a message; fixed joints in the message are ignored.

    Args:
        scene: Scene with the poses of frames.
        state: Transforms of joints; an empty header frame is the planning frame.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The counts of names and transforms differ, a joint is unknown or has one variable only, a
            transform is invalid, or the frame is unknown.
    """
    if len(state.joint_names) != len(state.transforms):
        raise PlanningError(
            ErrorCode.INVALID_ROBOT_STATE,
            f"{field_name}: multi_dof_joint_state with {len(state.joint_names)} joint names and "
            f"{len(state.transforms)} transforms; give one transform per name",
        )
    model = scene.model
    for name, message in zip(state.joint_names, state.transforms, strict=True):
        if model.base is not None and name == model.base.name:
            frame = scene.frame_transform(state.header.frame_id)
            transform = frame * transform_of(message, f"{field_name}: multi_dof_joint_state '{name}'")
            scene = scene.with_positions(model.with_base(scene.positions, transform))
        elif not _is_fixed(model, name):
            raise UnknownNameError(
                ErrorCode.INVALID_ROBOT_STATE,
                f"{field_name}: multi_dof_joint_state: planar or floating joint",
                name,
                [model.base.name] if model.base else [],
            )
    return scene


def _is_fixed(model: RobotModel, name: str) -> bool:
    """Returns whether the name belongs to a fixed joint of the URDF or a virtual joint of the SRDF."""
    virtual = (joint.name for joint in model.semantics.virtual_joints)
    return model.document.joint_kinds.get(name) == "fixed" or name in virtual


def with_angles(scene: PlanningScene, constraints: Sequence[Any], field_name: str, code: ErrorCode) -> list[Any]:
    """Replaces joint constraints on the quaternion of a floating base by constraints on the base's angles.

    Args:
        scene: Scene; its current angles decide between equivalent angles.
        constraints: Messages of type moveit_msgs/JointConstraint, as MoveIt's clients write them from a state.
        field_name: Name of the message field, for error messages.
        code: Error code for invalid constraints.

    Raises:
        PlanningError: A component of the quaternion is missing, or the quaternion is invalid.
    """
    base, model = scene.model.base, scene.model
    components = {
        item.joint_name: item for item in constraints if base is not None and item.joint_name in base.quaternion
    }
    if base is None or not components:
        return list(constraints)
    if len(components) != len(base.quaternion):
        raise PlanningError(
            code,
            f"{field_name}: joint constraints on {', '.join(components)} only; "
            f"give all of {', '.join(base.quaternion)}, or {', '.join(base.angles)} [rad]",
        )
    try:
        rotation = make_transform((0.0, 0.0, 0.0), [components[name].position for name in base.quaternion], field_name)
    except GeometryError as error:
        raise PlanningError(code, error.reason) from error
    values = base.values(rotation, scene.positions[model.base_indices])
    # a quaternion contains half angles
    tolerance = 2.0 * min(min(item.tolerance_above, item.tolerance_below) for item in components.values())
    angles = [
        JointConstraint(name, float(value), tolerance, tolerance, 1.0)
        for name, value in zip(base.variables, values, strict=True)
        if name in base.angles
    ]
    return [item for item in constraints if item.joint_name not in components] + angles


def goal_values(model: RobotModel, joints: Sequence[str], positions: Array) -> dict[str, float]:
    """Returns goal positions by joint name, with the rotation of a floating base as a quaternion, as in MoveIt.

    Args:
        model: Robot model.
        joints: Joints of the group.
        positions: Joint positions of the whole robot [rad or m].
    """
    goal = {name: float(positions[model.index[name]]) for name in joints}
    base = model.base
    if base is None or not base.quaternion or base.variables[0] not in goal:
        return goal
    q = pose_message(model.base_transform(positions)).orientation
    quaternion = dict(zip(base.quaternion, (q.x, q.y, q.z, q.w), strict=True))
    return {name: value for name, value in goal.items() if name not in base.angles} | quaternion


def multi_dof_message(model: RobotModel, positions: Array) -> MultiDOFJointState:
    """Returns the base's pose in the planning frame; the message of a fixed-base robot names no joint."""
    message = MultiDOFJointState()
    message.header.frame_id = model.planning_frame
    if model.base is not None:
        message.joint_names = [model.base.name]
        message.transforms = [transform_message(model.base_transform(positions))]
    return message


def single_joints(model: RobotModel, names: Sequence[str]) -> list[int]:
    """Returns the columns of single-variable joints, which are all joints except the base."""
    base = frozenset(model.base.variables if model.base else ())
    return [index for index, name in enumerate(names) if name not in base]


def multi_dof_trajectory(model: RobotModel, trajectory: Trajectory) -> MultiDOFJointTrajectory:
    """Returns poses, velocities and accelerations of the base in the planning frame.

    The message has no points if the trajectory does not move the base.
    """
    message = MultiDOFJointTrajectory()
    message.header.frame_id = model.planning_frame
    names = list(trajectory.joint_names)
    if model.base is None or model.base.variables[0] not in names:
        return message
    columns = [names.index(name) for name in model.base.variables]
    message.joint_names = [model.base.name]
    for index, time in enumerate(trajectory.times):
        positions, velocities, accelerations = (
            rows[index, columns] for rows in (trajectory.positions, trajectory.velocities, trajectory.accelerations)
        )
        velocity, acceleration = model.base.twists(positions, velocities, accelerations)
        message.points.append(
            MultiDOFJointTrajectoryPoint(
                transforms=[transform_message(model.base.transform(positions))],
                velocities=[_twist(velocity)],
                accelerations=[_twist(acceleration)],
                time_from_start=genpy.Duration.from_sec(float(time)),
            )
        )
    return message


def _twist(values: Array) -> Twist:
    return Twist(Vector3(*values[:3].tolist()), Vector3(*values[3:].tolist()))
