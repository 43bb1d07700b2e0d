# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints of an SDF model; the frame of a joint axis depends on the SDF version."""

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
"""Last version with axes in the model frame; later versions use the joint frame."""
_AXIS_EXPRESSED_IN_FROM: Version = (1, 7)
"""First version with an attribute for the frame of an axis; older versions have a child element."""


def read_joint(node: XmlNode, frames: FrameTree, version: Version) -> specs.Joint:
    """Reads a <joint>.

    Args:
        node: The <joint> element.
        frames: Frames of the model.
        version: SDF version of the file.

    Raises:
        DescriptionError: The joint type is not simulated, or the joint has invalid content.
    """
    kind = node.choice("type", specs.JointType, "joint type")
    child_node = node.require("child")
    parent, child = frames.link_of(node.require("parent")), frames.link_of(child_node)
    if child == specs.WORLD:
        if kind is not specs.JointType.FIXED:
            allowed = "allowed: the world as the parent of a movable joint; exchange <parent> and <child>"
            raise DescriptionError(child_node.location, "is the world", allowed)
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
        location = (axis_node.find("limit") or axis_node).location
        raise DescriptionError(
            location, f"got lower {lower:g} and upper {upper:g}", "allowed: a lower limit below the upper limit"
        )
    return specs.Joint(
        node.name(),
        kind,
        parent,
        child,
        pose=pose,
        axis=axis,
        lower=lower,
        upper=upper,
        effort=drive_bound(axis_node, "effort"),
        velocity=drive_bound(axis_node, "velocity"),
        dynamics=read_joint_dynamics(axis_node),
        location=node.location,
    )


def _without_axis(node: XmlNode, kind: specs.JointType, parent: str, child: str, pose: Pose) -> specs.Joint:
    along_z = (0.0, 0.0, 1.0)
    return specs.Joint(
        node.name(),
        kind,
        parent,
        child,
        pose=pose,
        axis=along_z,
        lower=-math.inf,
        upper=math.inf,
        location=node.location,
    )


def _axis_in_joint(node: XmlNode, joint_in_model: Pose, frames: FrameTree, version: Version) -> Vector3:
    """Returns the unit vector of an axis in the joint frame."""
    xyz = node.find("xyz")
    x, y, z = xyz.numbers(3) if xyz is not None else (0.0, 0.0, 1.0)
    length = math.hypot(x, y, z)
    if not 1e-9 <= length < math.inf:
        raise DescriptionError((xyz or node).location, f"got an axis of length {length:g}", "expected a direction")
    axis = (x / length, y / length, z / length)
    axis_frame = _frame_of_axis(node, frames, version)
    if axis_frame is None:
        return axis
    return rotate_vector(joint_in_model.inverse().quaternion, rotate_vector(axis_frame.quaternion, axis))


def _frame_of_axis(node: XmlNode, frames: FrameTree, version: Version) -> Pose | None:
    """Returns the pose of an axis's reference frame in the model frame; None for the joint frame."""
    if version <= _AXIS_IN_MODEL_FRAME_UNTIL:
        return Pose()
    if version < _AXIS_EXPRESSED_IN_FROM:
        in_model = node.find("use_parent_model_frame")
        return Pose() if in_model is not None and in_model.flag() else None
    xyz = node.find("xyz")
    frame = xyz.attributes.get("expressed_in", "") if xyz is not None else ""
    return frames.pose_in_model(frame) if frame else None
