# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms from positions and xyzw quaternions, with validation."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.errors import GeometryError

Array = NDArray[np.float64]
Transform = Any  # pinocchio.SE3: Pinocchio ships no type information

IDENTITY_XYZW = (0.0, 0.0, 0.0, 1.0)
LOGGER = logging.getLogger("rosout.poses")


def make_transform(position: Sequence[float], quaternion_xyzw: Sequence[float], source_name: str = "pose") -> Transform:
    """Returns the transform of a pose.

    Args:
        position: Position x, y, z [m].
        quaternion_xyzw: Quaternion x, y, z, w with any norm above 0; it is normalised.
        source_name: Origin of the pose, for error messages.

    Raises:
        GeometryError: A number is not finite, or the quaternion is zero.
    """
    translation = np.asarray(position, dtype=float)
    quaternion = np.asarray(quaternion_xyzw, dtype=float)
    if not (np.isfinite(translation).all() and np.isfinite(quaternion).all()):
        raise GeometryError(
            f"{source_name}: position {list(position)} or orientation {list(quaternion_xyzw)} contains a number "
            "that is not finite; all numbers must be finite"
        )
    max_component = float(np.abs(quaternion).max())
    if max_component == 0.0:
        raise GeometryError(f"{source_name}: quaternion xyzw 0 0 0 0 has norm 0; the identity is 0 0 0 1")
    quaternion = quaternion / max_component  # avoids underflow and overflow of squares
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), translation)


def quaternion_or_identity(quaternion_xyzw: Sequence[float], source_name: str) -> Sequence[float]:
    """Returns the quaternion; for a zero quaternion, as in an empty message, the identity with a warning."""
    if any(quaternion_xyzw):
        return quaternion_xyzw
    LOGGER.warning("%s: quaternion xyzw 0 0 0 0 has norm 0; the identity 0 0 0 1 is used", source_name)
    return IDENTITY_XYZW


def pose_of(transform: Transform) -> tuple[Array, Array]:
    """Returns the position [m] and the xyzw quaternion of a transform."""
    return np.array(transform.translation), np.array(pin.Quaternion(transform.rotation).coeffs())
