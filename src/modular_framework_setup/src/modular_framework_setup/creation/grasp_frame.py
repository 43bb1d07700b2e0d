# SPDX-License-Identifier: BSD-3-Clause
"""Where a gripper holds an object: a frame between its pads, found from the shapes of its fingers."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.finger_shapes import finger_points, with_gripper
from modular_framework_setup.creation.robot_parts import Gripper

BEHIND_TIPS = 0.25
"""How far behind the finger tips an object is held, as a share of how far the fingers stand out of the palm."""


def grasp_pose(model: RobotModel, gripper: Gripper, open_position: float, closed_position: float) -> Array:
    """Returns the pose of the grasp frame in the palm's frame, shape (4, 4) [m].

    Its z axis is the approach, from the palm to the finger tips; its x axis is that along which the fingers close.
    """
    opened, closed = (finger_points(model, gripper, position) for position in (open_position, closed_position))
    fingers = sorted(opened)
    centres = np.array([opened[name].mean(axis=0) for name in fingers])
    closing = _closing(centres, centres - np.array([closed[name].mean(axis=0) for name in fingers]))
    points = np.concatenate([opened[name] for name in fingers])
    approach = _approach(points, closing)
    along = points @ approach
    held = along.max() - BEHIND_TIPS * np.ptp(along)
    pads = [pad for name in fingers if (pad := _pads(opened[name], approach, held)) is not None]
    across = np.mean(pads, axis=0)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 2] = closing, approach
    pose[:3, 1] = np.cross(approach, closing)
    pose[:3, 3] = across + (held - across @ approach) * approach
    return pose


def approach_axis(model: RobotModel, gripper: Gripper, tip: str, open_position: float) -> Array:
    """Returns the axis of a tip's frame that is nearest to the way from the palm to the finger tips, shape (3,)."""
    state = with_gripper(model, model.default_positions(), gripper, open_position)
    poses = model.link_transforms(state)
    points = np.concatenate(list(finger_points(model, gripper, open_position).values()))
    way = poses[gripper.palm].rotation @ points.mean(axis=0)
    local = poses[tip].rotation.T @ way
    axis = np.zeros(3)
    axis[np.argmax(np.abs(local))] = np.sign(local[np.argmax(np.abs(local))])
    return axis


def _closing(centres: Array, motion: Array) -> Array:
    """Returns the axis along which fingers close, shape (3,).

    A finger may hang on the palm by several links. The motion of the first link shows on which side each one is.

    Args:
        centres: of what hangs on the palm, opened, shape (n, 3) [m].
        motion: of the centres from closed to open, shape (n, 3) [m].
    """
    if len(motion) == 1:
        return _unit(motion[0])
    away = motion[0] - motion[1:].mean(axis=0)
    on_first_side = (centres - centres.mean(axis=0)) @ away > 0.0
    if on_first_side.all() or not on_first_side.any():
        return _unit(away)
    return _unit(motion[on_first_side].mean(axis=0) - motion[~on_first_side].mean(axis=0))


def _approach(points: Array, closing: Array) -> Array:
    """Returns the axis of the palm, across the closing direction, along which the fingers stand out furthest."""
    mean = points.mean(axis=0)
    axes = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    best = max(axes, key=lambda axis: float(mean @ axis) - abs(float(axis @ closing)) * np.linalg.norm(mean))
    return _unit(best - (best @ closing) * closing)


def _pads(points: Array, approach: Array, held: float) -> Array | None:
    """Returns the middle of a finger's points beyond where objects are held; None when it does not reach there."""
    beyond = points[points @ approach >= held]
    if not len(beyond):
        return None
    return np.asarray(0.5 * (beyond.min(axis=0) + beyond.max(axis=0)))


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return np.asarray(vector / length) if length > 1e-9 else np.array([1.0, 0.0, 0.0])
