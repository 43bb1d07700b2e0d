# SPDX-License-Identifier: BSD-3-Clause
"""Computes points on the shapes of a gripper's fingers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modular_framework_planning.geometry.shapes import Mesh
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import LinkGeometry, RobotModel
from modular_framework_setup.creation.robot_parts import Gripper


def with_gripper(model: RobotModel, state: Array, gripper: Gripper, position: float) -> Array:
    """Returns joint positions after moving a gripper.

    Args:
        model: Robot model.
        state: Joint positions, shape (joints,) [rad or m].
        gripper: Gripper to move.
        position: Position of the gripper's driven joint [rad or m].
    """
    result = np.array(state, dtype=float)
    result[model.joint_index(gripper.driver)] = position
    return model.with_mimics(result)


def finger_of(model: RobotModel, gripper: Gripper, link: str) -> str:
    """Returns the first link of the finger that contains a link.

    Args:
        model: Robot model.
        gripper: Gripper of the finger.
        link: Link of the finger.
    """
    for _, parent in model.tree.up(link):
        if parent == gripper.palm:
            break
        link = parent
    return link


def link_points(model: RobotModel, gripper: Gripper, position: float) -> Mapping[str, Array]:
    """Returns points on the shapes of each finger link in the palm frame, shape (n, 3) [m].

    Args:
        model: Robot model.
        gripper: Gripper.
        position: Position of the gripper's driven joint [rad or m].
    """
    poses = model.link_transforms(with_gripper(model, model.default_positions(), gripper, position))
    points: dict[str, list[Array]] = {}
    for item in model.link_geometries:
        if item.link in gripper.links:
            pose_in_link = model.pin_model.frames[item.frame_id].placement.inverse() * item.placement
            pose_in_palm = poses[gripper.palm].inverse() * poses[item.link] * pose_in_link
            points.setdefault(item.link, []).append(_points(item) @ pose_in_palm.rotation.T + pose_in_palm.translation)
    return {name: np.concatenate(items) for name, items in points.items()}


def finger_points(model: RobotModel, gripper: Gripper, position: float) -> Mapping[str, Array]:
    """Returns points on the shapes of each finger in the palm frame, by first link, shape (n, 3) [m].

    Args:
        model: Robot model.
        gripper: Gripper.
        position: Position of the gripper's driven joint [rad or m].
    """
    fingers: dict[str, list[Array]] = {}
    for link, points in link_points(model, gripper, position).items():
        fingers.setdefault(finger_of(model, gripper, link), []).append(points)
    return {name: np.concatenate(items) for name, items in fingers.items()}


def _points(item: LinkGeometry) -> Array:
    """Returns the vertices of a mesh, or the corners of the bounding box of any other shape."""
    if isinstance(item.shape, Mesh):
        return np.asarray(item.shape.vertices)
    item.geometry.computeLocalAABB()
    box = item.geometry.aabb_local
    corners = np.array([box.min_, box.max_])
    return np.array([[corners[i, 0], corners[j, 1], corners[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
