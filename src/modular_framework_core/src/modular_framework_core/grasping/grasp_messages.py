# SPDX-License-Identifier: BSD-3-Clause
"""Builds grasp messages, so that grasp methods are independent of the message layout."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from sensor_msgs.msg import JointState

from modular_framework_core.msg import ManipulatorState, StandardisedGrasp, TorqueIntensity
from modular_framework_urdf.rotations import quaternion_from_rpy


def generate_joint_state_message(
    joint_names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    reference_frame_name: str = "world",
) -> JointState:
    """Returns a joint state message with the current time.

    Args:
        joint_names: Joint names.
        position: Joint positions [rad or m].
        velocity: Joint velocities [rad/s or m/s]; may be empty.
        effort: Joint efforts [Nm or N]; may be empty.
        reference_frame_name: Frame of the header.
    """
    state = JointState(name=list(joint_names), position=list(position), velocity=list(velocity), effort=list(effort))
    state.header.stamp, state.header.frame_id = rospy.Time.now(), reference_frame_name
    return state


def generate_pose_stamped_message(
    reference_frame_name: str, position: Sequence[float], orientation: Sequence[float]
) -> PoseStamped:
    """Returns a stamped pose with the current time.

    Args:
        reference_frame_name: Frame of the pose.
        position: x, y, z [m].
        orientation: Roll, pitch, yaw [rad], or a quaternion x, y, z, w.

    Raises:
        ValueError: The position does not have three values, or the orientation does not have three or four values.
    """
    if len(position) != 3 or len(orientation) not in (3, 4):
        raise ValueError(
            "a pose needs 3 position values and 3 (roll, pitch, yaw) or 4 (x, y, z, w) orientation values; "
            f"got {len(position)} and {len(orientation)}"
        )
    quaternion = tuple(orientation) if len(orientation) == 4 else quaternion_from_rpy(*orientation)
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = rospy.Time.now(), reference_frame_name
    message.pose.position, message.pose.orientation = Point(*position), Quaternion(*quaternion)
    return message


def get_standardised_grasp(  # noqa: PLR0913, PLR0917 - the original framework's signature, also in C++
    manipulator_joint_names: Sequence[str],
    pregrasp_joint_values: Sequence[float],
    grasp_joint_values: Sequence[float],
    postgrasp_joint_values: Sequence[float],
    torque_intensity: Sequence[float],
    pregrasp_pose: PoseStamped,
    grasp_pose: PoseStamped,
    postgrasp_pose: PoseStamped,
    grasp_quality: float = 0.0,
    grasp_id: str = "",
    hand_id: str = "",
    object_id: str = "",
) -> StandardisedGrasp:
    """Returns a grasp message whose postures have the current time.

    Args:
        manipulator_joint_names: Joints of the manipulator, for the postures and the torques.
        pregrasp_joint_values: Joint positions before the grasp [rad or m].
        grasp_joint_values: Joint positions of the grasp [rad or m].
        postgrasp_joint_values: Joint positions after the grasp [rad or m].
        torque_intensity: Fraction of the maximum torque of each joint, in [-1, 1].
        pregrasp_pose: Pose of the hand before the grasp.
        grasp_pose: Pose of the hand at the grasp.
        postgrasp_pose: Pose of the hand after the grasp.
        grasp_quality: Quality of the grasp; higher is better.
        grasp_id: Name of the grasp.
        hand_id: Name of the hand.
        object_id: Name of the object.
    """
    stages = [
        ManipulatorState(generate_joint_state_message(manipulator_joint_names, values, (), (), ""), pose)
        for values, pose in (
            (pregrasp_joint_values, pregrasp_pose),
            (grasp_joint_values, grasp_pose),
            (postgrasp_joint_values, postgrasp_pose),
        )
    ]
    torques = TorqueIntensity(list(manipulator_joint_names), list(torque_intensity))
    return StandardisedGrasp(grasp_id, hand_id, object_id, *stages, torques, float(grasp_quality))
