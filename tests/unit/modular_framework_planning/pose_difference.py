# SPDX-License-Identifier: BSD-3-Clause
"""How far two poses are apart."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


def pose_difference(first: pin.SE3, second: pin.SE3) -> tuple[float, float]:
    """Returns the distance [m] and the angle [rad] between two poses given in one frame."""
    distance = float(np.linalg.norm(first.translation - second.translation))
    angle = float(np.linalg.norm(pin.log3(first.rotation.T @ second.rotation)))
    return distance, angle
