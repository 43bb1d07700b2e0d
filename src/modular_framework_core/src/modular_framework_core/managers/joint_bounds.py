# SPDX-License-Identifier: BSD-3-Clause
"""Reads the joints of the robot and their bounds, so that a named joint state is checked before it is used."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from modular_framework_core.files.faults import nearest
from modular_framework_urdf.urdf_reader import read_urdf

Bounds = tuple[float, float]
TOLERANCE = 1e-6  # [rad or m]; numbers rounded in a file may end just outside


@lru_cache(maxsize=1)
def bounds_from_urdf(text: str) -> Mapping[str, Bounds]:
    """Returns (lower, upper) [rad or m] of every joint that moves; a continuous joint has no bounds.

    Raises:
        ValueError: The text is no XML, has a DOCTYPE, or a limit is no number.
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
    """Says what is wrong with a joint's position; nothing when it is all right or no joint is known.

    Args:
        joint: Name of the joint.
        position: Its position [rad or m].
        bounds: (lower, upper) of each joint of the robot; empty switches the check off.
    """
    if not bounds:
        return ""
    if joint not in bounds:
        return f"the robot has no joint '{joint}' that moves; it has {', '.join(bounds)}{nearest(joint, bounds)}"
    lower, upper = bounds[joint]
    if not lower - TOLERANCE <= position <= upper + TOLERANCE:
        return f"got {position}, the joint moves from {lower:.4f} to {upper:.4f}"
    return ""
