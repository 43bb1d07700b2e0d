# SPDX-License-Identifier: BSD-3-Clause
"""Poses of the hand during an episode, from the measured joints and the robot's description."""

from __future__ import annotations

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import JointSamples, ObjectTrack
from modular_framework_urdf.srdf_reader import read_srdf


def hand_link(srdf: str) -> str:
    """Returns the parent link of a robot's first end effector; "" without end effectors.

    Args:
        srdf: Semantic description (SRDF text).
    """
    effectors = read_srdf(srdf, "the parameter /robot_description_semantic").end_effectors
    return effectors[0].parent_link if effectors else ""


def hand_track(urdf: str, link: str, joints: JointSamples) -> ObjectTrack:
    """Returns the poses of a link in the robot's root frame, which coincides with the simulation's world frame.

    Args:
        urdf: Robot description (URDF text).
        link: Name of the link.
        joints: Measured joint positions; joints without measurements are at 0.
    """
    model = pinocchio.buildModelFromXML(urdf)
    data, frame = model.createData(), model.getFrameId(link)
    columns = [
        (number, model.joints[model.getJointId(name)])
        for number, name in enumerate(joints.joints)
        if model.existJointName(name)
    ]
    poses = np.empty((len(joints.times_s), 7))
    configuration = pinocchio.neutral(model)
    for row, positions in enumerate(joints.positions):
        for number, joint in columns:
            angle = positions[number]
            # Pinocchio stores a continuous joint as cosine and sine.
            configuration[joint.idx_q : joint.idx_q + joint.nq] = (
                angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            )
        pinocchio.forwardKinematics(model, data, configuration)
        pose = pinocchio.updateFramePlacement(model, data, frame)
        poses[row, :3] = pose.translation
        poses[row, 3:] = Rotation.from_matrix(pose.rotation).as_quat()
    return ObjectTrack(link, joints.times_s, poses[:, :3], poses[:, 3:])
