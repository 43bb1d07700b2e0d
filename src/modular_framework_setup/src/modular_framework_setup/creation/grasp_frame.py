# SPDX-License-Identifier: BSD-3-Clause
"""Computes a gripper's grasp frame between the pads from the shapes of the fingers."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.finger_shapes import finger_points, with_gripper
from modular_framework_setup.creation.robot_parts import Gripper

TIP_OFFSET = 0.25
"""Distance of the grasp frame behind the fingertips, as a fraction of the fingers' extent along the approach axis."""


def grasp_pose(model: RobotModel, gripper: Gripper, open_position: float, closed_position: float) -> Array:
    """Returns the pose of the grasp frame in the palm frame, shape (4, 4) [m].

    The z axis is the approach axis, from the palm to the fingertips; the fingers close along the x axis.

    Args:
        model: Robot model.
        gripper: Gripper.
        open_position: Open position of the gripper's driven joint [rad or m].
        closed_position: Closed position of the gripper's driven joint [rad or m].
    """
    opened, closed = (finger_points(model, gripper, position) for position in (open_position, closed_position))
    fingers = sorted(opened)
    centres = np.array([opened[name].mean(axis=0) for name in fingers])
    closing = _closing_axis(centres, centres - np.array([closed[name].mean(axis=0) for name in fingers]))
    points = np.concatenate([opened[name] for name in fingers])
    approach = _approach_axis(points, closing)
    heights = points @ approach
    grasp_height = heights.max() - TIP_OFFSET * np.ptp(heights)
    pads = [pad for name in fingers if (pad := _pad_centre(opened[name], approach, grasp_height)) is not None]
    centre = np.mean(pads, axis=0)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 2] = closing, approach
    pose[:3, 1] = np.cross(approach, closing)
    pose[:3, 3] = centre + (grasp_height - centre @ approach) * approach
    return pose


def approach_axis(model: RobotModel, gripper: Gripper, tip: str, open_position: float) -> Array:
    """Returns the axis of the tip frame closest to the direction from the palm to the fingers, shape (3,).

    Args:
        model: Robot model.
        gripper: Gripper.
        tip: Tip link of the arm.
        open_position: Open position of the gripper's driven joint [rad or m].
    """
    state = with_gripper(model, model.default_positions(), gripper, open_position)
    poses = model.link_transforms(state)
    points = np.concatenate(list(finger_points(model, gripper, open_position).values()))
    direction = poses[gripper.palm].rotation @ points.mean(axis=0)
    local = poses[tip].rotation.T @ direction
    axis = np.zeros(3)
    axis[np.argmax(np.abs(local))] = np.sign(local[np.argmax(np.abs(local))])
    return axis


def _closing_axis(centres: Array, motion: Array) -> Array:
    """Returns the axis along which fingers close, shape (3,).

    A finger may be attached to the palm by several links; the motion of the first link assigns the links to two sides.

    Args:
        centres: Centres of the links attached to the palm, gripper open, shape (n, 3) [m].
        motion: Displacements of the centres from closed to open, shape (n, 3) [m].
    """
    if len(motion) == 1:
        return _unit(motion[0])
    opening = motion[0] - motion[1:].mean(axis=0)
    on_first_side = (centres - centres.mean(axis=0)) @ opening > 0.0
    if on_first_side.all() or not on_first_side.any():
        return _unit(opening)
    return _unit(motion[on_first_side].mean(axis=0) - motion[~on_first_side].mean(axis=0))


def _approach_axis(points: Array, closing: Array) -> Array:
    """Returns the palm axis along which the fingers protrude furthest, orthogonalized to the closing axis."""
    mean = points.mean(axis=0)
    axes = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    best = max(axes, key=lambda axis: float(mean @ axis) - abs(float(axis @ closing)) * np.linalg.norm(mean))
    return _unit(best - (best @ closing) * closing)


def _pad_centre(points: Array, approach: Array, grasp_height: float) -> Array | None:
    """Returns the centre of a finger's points above the grasp height, or None for a shorter finger."""
    pad_points = points[points @ approach >= grasp_height]
    if not len(pad_points):
        return None
    return np.asarray(0.5 * (pad_points.min(axis=0) + pad_points.max(axis=0)))


def _unit(vector: Array) -> Array:
    norm = float(np.linalg.norm(vector))
    return np.asarray(vector / norm) if norm > 1e-9 else np.array([1.0, 0.0, 0.0])
