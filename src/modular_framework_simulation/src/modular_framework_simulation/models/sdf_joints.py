# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints of an SDF model, whose axes are written in frames that differ from version to version."""

from __future__ import annotations

import math

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import FrameTree
from modular_framework_simulation.models.sdf_surface import drive_bound, joint_bound, read_joint_dynamics
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_urdf.rotations import Vector3, rotate_vector

Version = tuple[int, ...]

_WITHOUT_AXIS = (specs.JointType.FIXED, specs.JointType.BALL)

_AXIS_IN_MODEL_FRAME_UNTIL: Version = (1, 4)
"""Until this version an axis is given in the frame of the model, later in that of the joint."""
_AXIS_EXPRESSED_IN_FROM: Version = (1, 7)
"""From this version an attribute names the frame of an axis; before it a child element chose the model's."""


def read_joint(node: XmlNode, frames: FrameTree, version: Version) -> specs.Joint:
    """Reads a <joint>.

    Args:
        node: The element.
        frames: Of the model.
        version: Of SDF, of the file.

    Raises:
        DescriptionError: The joint is of a kind that is not simulated, or something in it cannot be used.
    """
    kind = node.choice("type", specs.JointType, "joint type")
    child_node = node.require("child")
    parent, child = frames.link_of(node.require("parent")), frames.link_of(child_node)
    if child == specs.WORLD:
        if kind is not specs.JointType.FIXED:
            allowed = "allowed: the world as the parent of a joint that moves; exchange <parent> and <child>"
            raise DescriptionError(child_node.where, "is the world", allowed)
        return _without_axis(node, kind, specs.WORLD, parent, Pose())
    joint_in_model = frames.joint_pose_in_model(node)
    pose = frames.pose_in_model(child).inverse() @ joint_in_model
    if kind in _WITHOUT_AXIS:
        return _without_axis(node, kind, parent, child, pose)
    axis_node = node.require("axis")
    axis = _axis_in_joint(axis_node, joint_in_model, frames, version)
    lower, upper = joint_bound(axis_node, "lower", -math.inf), joint_bound(axis_node, "upper", math.inf)
    if kind is specs.JointType.CONTINUOUS:
        lower, upper = -math.inf, math.inf
    if lower > upper:
        where = (axis_node.find("limit") or axis_node).where
        raise DescriptionError(
            where, f"got lower {lower:g} and upper {upper:g}", "allowed: a lower one below the upper"
        )
    return specs.Joint(
        node.name(),
        kind,
        parent,
        child,
        pose,
        axis,
        lower,
        upper,
        drive_bound(axis_node, "effort"),
        drive_bound(axis_node, "velocity"),
        read_joint_dynamics(axis_node),
        node.where,
    )


def _without_axis(node: XmlNode, kind: specs.JointType, parent: str, child: str, pose: Pose) -> specs.Joint:
    along_z = (0.0, 0.0, 1.0)
    return specs.Joint(node.name(), kind, parent, child, pose, along_z, -math.inf, math.inf, where=node.where)


def _axis_in_joint(node: XmlNode, joint_in_model: Pose, frames: FrameTree, version: Version) -> Vector3:
    """Returns the unit vector of an axis in the frame of its joint."""
    xyz = node.find("xyz")
    x, y, z = xyz.numbers(3) if xyz is not None else (0.0, 0.0, 1.0)
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        raise DescriptionError((xyz or node).where, "got an axis of length 0", "expected a direction")
    axis = (x / length, y / length, z / length)
    written_in = _frame_of_axis(node, frames, version)
    if written_in is None:
        return axis
    return rotate_vector(joint_in_model.inverse().quaternion, rotate_vector(written_in.quaternion, axis))


def _frame_of_axis(node: XmlNode, frames: FrameTree, version: Version) -> Pose | None:
    """Returns the pose in the model of the frame an axis is written in; None for the frame of the joint."""
    if version <= _AXIS_IN_MODEL_FRAME_UNTIL:
        return Pose()
    if version < _AXIS_EXPRESSED_IN_FROM:
        in_model = node.find("use_parent_model_frame")
        return Pose() if in_model is not None and in_model.flag() else None
    xyz = node.find("xyz")
    frame = xyz.attributes.get("expressed_in", "") if xyz is not None else ""
    return frames.pose_in_model(frame) if frame else None
