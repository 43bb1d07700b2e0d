# SPDX-License-Identifier: BSD-3-Clause
"""Checks joint positions against the joint limits of the URDF."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from modular_framework_ros.allowed_names import nearest
from modular_framework_urdf.urdf_reader import read_urdf

Bounds = tuple[float, float]
TOLERANCE = 1e-6  # [rad or m], for positions rounded in a file


@lru_cache(maxsize=1)
def bounds_from_urdf(text: str) -> Mapping[str, Bounds]:
    """Returns (lower, upper) [rad or m] of every movable joint, infinite for continuous joints.

    Raises:
        ValueError: The text is not XML, has a DOCTYPE, or a limit is not a number.
    """
    bounds: dict[str, Bounds] = {}
    for joint in read_urdf(text).joints:
        match joint.kind:
            case "revolute" | "prismatic" if joint.limit is not None:
                bounds[joint.name] = joint.limit.lower, joint.limit.upper
            case "continuous":
                bounds[joint.name] = -math.inf, math.inf
    return MappingProxyType(bounds)


def bounds_fault(joint: str, position: float, bounds: Mapping[str, Bounds]) -> str:
    """Returns the fault of a joint position, or "" if the position is within the limits.

    Args:
        joint: Joint name.
        position: Joint position [rad or m].
        bounds: (lower, upper) [rad or m] of each joint; empty to disable the check.
    """
    if not bounds:
        return ""
    if joint not in bounds:
        return f"the robot has no movable joint '{joint}'; it has {', '.join(bounds)}{nearest(joint, bounds)}"
    lower, upper = bounds[joint]
    if not lower - TOLERANCE <= position <= upper + TOLERANCE:
        return f"got {position}, the joint moves from {lower:.4f} to {upper:.4f}"
    return ""
