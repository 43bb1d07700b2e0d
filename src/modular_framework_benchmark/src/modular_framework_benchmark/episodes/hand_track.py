# SPDX-License-Identifier: BSD-3-Clause
"""Where the hand was during an episode, from the measured joints and the robot's description."""

from __future__ import annotations

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import JointSamples, ObjectTrack
from modular_framework_urdf.srdf_reader import read_srdf


def hand_link(srdf: str) -> str:
    """Returns the link that the first end effector of a robot is fixed to; "" if it has none.

    Args:
        srdf: Semantic description, text.
    """
    effectors = read_srdf(srdf, "the parameter /robot_description_semantic").end_effectors
    return effectors[0].parent_link if effectors else ""


def hand_track(urdf: str, link: str, joints: JointSamples) -> ObjectTrack:
    """Returns the poses of a link in the root frame of the robot's description, which is the world in simulation.

    Args:
        urdf: Description of the robot, text.
        link: The link.
        joints: Measured joints; those that are not measured stay at 0.
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
            # a joint without ends is stored as cosine and sine
            configuration[joint.idx_q : joint.idx_q + joint.nq] = (
                angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            )
        pinocchio.forwardKinematics(model, data, configuration)
        pose = pinocchio.updateFramePlacement(model, data, frame)
        poses[row, :3] = pose.translation
        poses[row, 3:] = Rotation.from_matrix(pose.rotation).as_quat()
    return ObjectTrack(link, joints.times_s, poses[:, :3], poses[:, 3:])
