# SPDX-License-Identifier: BSD-3-Clause
"""Output of a grasp method, and the checks of this output."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Mapping

import numpy as np

from mbf_method.errors import InvalidOutputError
from mbf_method.grasp_request import GraspRequest

ITEM_SHAPES = {"poses": (4, 4), "scores": (), "widths": ()}
"""Shape of one grasp in each array."""
ROTATION_TOLERANCE = 1e-3
"""Maximum deviation of an element of R^T R from the identity; single-precision rotations are accurate to 1e-6."""


@dataclass(frozen=True)
class Grasps:
    """Grasps of an object, in any order.

    Attributes:
        frame: Frame of the poses; must be the frame of the request.
        poses: Poses of the hand, shape (n, 4, 4) [m]. The origin is the centre between the closed pads; x is the
            closing direction, z the approach direction.
        scores: Scores in [0, 1], shape (n,); higher is better.
        widths: Widths of the object between the pads, shape (n,) [m].
    """

    frame: str
    poses: np.ndarray
    scores: np.ndarray
    widths: np.ndarray


def checked_grasps(message: Mapping[str, Any], request: GraspRequest, max_grasps: int) -> Grasps:
    """Checks a result and returns its grasps.

    Args:
        message: Fields of `Grasps`, keyed by name.
        request: Request to which the result belongs.
        max_grasps: Maximum number of grasps.

    Raises:
        InvalidOutputError: A field name, shape, value or frame is invalid; the message lists all faults.
    """
    names = [field.name for field in dataclasses.fields(Grasps)]
    if sorted(message) != sorted(names):
        raise InvalidOutputError(f"the result has the fields {sorted(message)}; it must have {names}")
    faults = _shape_faults(message, max_grasps)
    if message["frame"] != request.frame:
        faults.append(f"the grasps are in frame {message['frame']!r}; the frame must be {request.frame!r}")
    if not faults:
        faults = _value_faults(message, request.gripper.max_opening)
    if faults:
        raise InvalidOutputError("; ".join(faults))
    arrays = {name: message[name].astype(np.float64) for name in ITEM_SHAPES}
    return Grasps(frame=request.frame, **arrays)


def _shape_faults(message: Mapping[str, Any], max_grasps: int) -> list[str]:
    faults = []
    for name, item_shape in ITEM_SHAPES.items():
        value = message[name]
        required = f"it must be an array of numbers of shape (n{''.join(f', {size}' for size in item_shape) or ','})"
        if not isinstance(value, np.ndarray):
            faults.append(f"{name} is a {type(value).__name__}; {required}")
        elif value.dtype.kind not in "fiu" or value.ndim == 0 or value.shape[1:] != item_shape:
            faults.append(f"{name} has shape {value.shape} and type {value.dtype}; {required}")
    if faults:
        return faults
    counts = [len(message[name]) for name in ITEM_SHAPES]
    if len(set(counts)) > 1:
        faults.append(f"{', '.join(ITEM_SHAPES)} have the lengths {counts}; all lengths must be equal")
    if max(counts) > max_grasps:
        faults.append(f"there are {max(counts)} grasps; at most {max_grasps} are allowed")
    return faults


def _value_faults(message: Mapping[str, Any], max_opening: float) -> list[str]:
    faults = []
    for name in ITEM_SHAPES:
        values = message[name]
        finite = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
        if not finite.all():
            faults.append(f"{name}[{np.argmin(finite)}] is not finite; all values must be finite")
    if faults:
        return faults
    for name, high in (("scores", 1.0), ("widths", max_opening)):
        values = message[name]
        inside = (values >= 0.0) & (values <= high)
        if not inside.all():
            worst = int(np.argmin(inside))
            faults.append(f"{name}[{worst}] is {values[worst]:g}; it must be from 0 to {high:g}")
    poses = message["poses"].astype(np.float64)
    rotations = poses[:, :3, :3]
    errors = np.abs(np.transpose(rotations, (0, 2, 1)) @ rotations - np.eye(3)).max(axis=(1, 2), initial=0.0)
    rigid = (errors <= ROTATION_TOLERANCE) & (np.linalg.det(rotations) > 0.0)
    rigid &= (poses[:, 3] == [0.0, 0.0, 0.0, 1.0]).all(axis=1)
    if not rigid.all():
        faults.append(
            f"poses[{np.argmin(rigid)}] is no rigid transform; it must have a right-handed rotation matrix and the "
            "last row 0 0 0 1"
        )
    return faults
