# SPDX-License-Identifier: BSD-3-Clause
"""Makes rigid transforms of positions and xyzw quaternions, and refuses numbers that are not a pose."""

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


def make_transform(position: Sequence[float], quaternion_xyzw: Sequence[float], where: str = "pose") -> Transform:
    """Builds the transform of a pose.

    Args:
        position: x, y, z [m].
        quaternion_xyzw: x, y, z, w; any length above 0 (it is normalised).
        where: what the pose belongs to, for the error text.

    Raises:
        GeometryError: a number is not finite, or the quaternion is all zeros.
    """
    translation = np.asarray(position, dtype=float)
    quaternion = np.asarray(quaternion_xyzw, dtype=float)
    if not (np.isfinite(translation).all() and np.isfinite(quaternion).all()):
        raise GeometryError(
            f"{where}: position {list(position)} or orientation {list(quaternion_xyzw)} holds a number "
            "that is not finite; every number must be finite"
        )
    largest = float(np.abs(quaternion).max())
    if largest == 0.0:
        raise GeometryError(f"{where}: quaternion xyzw 0 0 0 0 has length 0; the identity is 0 0 0 1")
    quaternion = quaternion / largest  # squares of very small or large numbers are 0 or infinite
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), translation)


def quaternion_or_identity(quaternion_xyzw: Sequence[float], where: str) -> Sequence[float]:
    """Returns the quaternion; for one of no length, as a message not filled in has it, the identity and a warning."""
    if any(quaternion_xyzw):
        return quaternion_xyzw
    LOGGER.warning("%s: quaternion xyzw 0 0 0 0 has no length; the identity 0 0 0 1 is used", where)
    return IDENTITY_XYZW


def pose_of(transform: Transform) -> tuple[Array, Array]:
    """Returns position [m] and xyzw quaternion of a transform."""
    return np.array(transform.translation), np.array(pin.Quaternion(transform.rotation).coeffs())
