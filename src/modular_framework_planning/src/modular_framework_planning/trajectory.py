# SPDX-License-Identifier: BSD-3-Clause
"""The timed motion of a group: what every planner returns and the wire carries."""
from __future__ import annotations

from dataclasses import dataclass

from modular_framework_planning.spatial import Array


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Samples of a motion.

    Attributes:
        joint_names: joints, in the order of the columns.
        times: strictly increasing, the first is 0 [s], shape (n,).
        positions, velocities, accelerations: shape (n, joints) [rad or m, per s, per s^2].
    """

    joint_names: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

    @property
    def duration_s(self) -> float:
        """Length of the motion."""
        return float(self.times[-1])
