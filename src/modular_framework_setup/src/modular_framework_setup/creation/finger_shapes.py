# SPDX-License-Identifier: BSD-3-Clause
"""Where the links of a gripper's fingers are, as points on their shapes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modular_framework_planning.geometry.shapes import Mesh
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import LinkGeometry, RobotModel
from modular_framework_setup.creation.robot_parts import Gripper


def with_gripper(model: RobotModel, state: Array, gripper: Gripper, position: float) -> Array:
    """Returns a state with a gripper at a position of its driver."""
    result = np.array(state, dtype=float)
    result[model.joint_index(gripper.driver)] = position
    return model.with_mimics(result)


def finger_of(model: RobotModel, gripper: Gripper, link: str) -> str:
    """Returns the link of the same finger that hangs on the palm."""
    above = {child: model.document.joint_parents[joint] for joint, child in model.document.joint_children.items()}
    while above.get(link, gripper.palm) != gripper.palm:
        link = above[link]
    return link


def link_points(model: RobotModel, gripper: Gripper, position: float) -> Mapping[str, Array]:
    """Returns points on the shapes of each link of the fingers in the palm's frame, shape (n, 3) [m]."""
    poses = model.link_transforms(with_gripper(model, model.default_positions(), gripper, position))
    found: dict[str, list[Array]] = {}
    for item in model.link_geometries:
        if item.link in gripper.links:
            in_link = model.pin_model.frames[item.frame_id].placement.inverse() * item.placement
            pose = poses[gripper.palm].inverse() * poses[item.link] * in_link
            found.setdefault(item.link, []).append(_points(item) @ pose.rotation.T + pose.translation)
    return {name: np.concatenate(items) for name, items in found.items()}


def finger_points(model: RobotModel, gripper: Gripper, position: float) -> Mapping[str, Array]:
    """Returns points on the shapes of each finger in the palm's frame, shape (n, 3) [m]."""
    found: dict[str, list[Array]] = {}
    for link, points in link_points(model, gripper, position).items():
        found.setdefault(finger_of(model, gripper, link), []).append(points)
    return {name: np.concatenate(items) for name, items in found.items()}


def _points(item: LinkGeometry) -> Array:
    """Returns the vertices of a mesh, or the corners of the box around another shape."""
    if isinstance(item.shape, Mesh):
        return np.asarray(item.shape.vertices)
    item.geometry.computeLocalAABB()
    box = item.geometry.aabb_local
    corners = np.array([box.min_, box.max_])
    return np.array([[corners[i, 0], corners[j, 1], corners[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
