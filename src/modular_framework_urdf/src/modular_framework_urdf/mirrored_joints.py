# SPDX-License-Identifier: BSD-3-Clause
"""Recognizes jaws with a common motor whose URDF has no <mimic>: mirror images of each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modular_framework_urdf.robot import Joint

AXIS_TOLERANCE = 5.0e-3
"""Maximum difference of two unit axes that count as parallel; descriptions round pi to 3.14."""


def mirror_multiplier(joint: Joint, other: Joint) -> float:
    """Returns the multiplier with which another joint mirrors a joint, or 0 for a joint that is no mirror image.

    Both joints have the same parent link and kind, parallel axes, and mirrored ranges. The multiplier is 1 for opposite
    axes with equal limits, and -1 for equal axes with opposite limits.

    Args:
        joint: Joint without <mimic>.
        other: Joint that may move with the first.
    """
    if joint.name == other.name or joint.mimic is not None or other.mimic is not None:
        return 0.0
    if (joint.parent, joint.kind) != (other.parent, other.kind) or joint.limit is None or other.limit is None:
        return 0.0
    axes = _axis_in_parent(joint), _axis_in_parent(other)
    for multiplier in (1.0, -1.0):
        ends = sorted((multiplier * other.limit.lower, multiplier * other.limit.upper))
        is_mirrored = np.allclose(axes[0], -multiplier * axes[1], atol=AXIS_TOLERANCE)
        if is_mirrored and ends == [joint.limit.lower, joint.limit.upper]:
            return multiplier
    return 0.0


def _axis_in_parent(joint: Joint) -> npt.NDArray[np.float64]:
    """Returns the axis of a joint in the frame of its parent link as a unit vector, shape (3,)."""
    axis = np.array(joint.axis)
    return np.asarray(joint.origin.matrix()[:3, :3] @ axis / (np.linalg.norm(axis) or 1.0))
