# SPDX-License-Identifier: BSD-3-Clause
"""Computes the poses of a model's links from the positions of its joints, without a physics engine."""

from __future__ import annotations

from collections.abc import Mapping

from modular_framework_simulation.models.joint_trees import joint_trees
from modular_framework_simulation.models.poses import Pose, joint_motion
from modular_framework_simulation.models.sdf_specs import WORLD, JointType, Model

_POSITIONED = (JointType.REVOLUTE, JointType.CONTINUOUS, JointType.PRISMATIC)
"""Types of joints with a position; other joints stay at their initial pose."""


def link_poses(model: Model, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Returns the poses of the links in the model frame, keyed by link name.

    Links that no joint connects to the first link are left out, because they move independently of the model frame.

    Args:
        model: Description of the model.
        positions: Joint positions, keyed by joint name [rad or m]; the default is 0.

    Raises:
        DescriptionError: The joints form a closed loop.
    """
    initial = {link.name: link.pose for link in model.links}
    if model.static:
        return initial
    initial[WORLD] = Pose()
    tree = joint_trees(model)[0]
    poses = {tree.root: initial[tree.root]}
    for joint in tree.joints:
        joint_in_parent = initial[joint.parent].inverse() @ initial[joint.child] @ joint.pose
        position = positions.get(joint.name, 0.0) if joint.kind in _POSITIONED else 0.0
        motion = joint_motion(joint.axis, position, is_prismatic=joint.kind is JointType.PRISMATIC)
        poses[joint.child] = poses[joint.parent] @ joint_in_parent @ motion @ joint.pose.inverse()
    return {name: poses[name] for name in tree.links}
