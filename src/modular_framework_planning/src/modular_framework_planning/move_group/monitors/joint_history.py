# SPDX-License-Identifier: BSD-3-Clause
"""Stores recent joint positions, because sensor data are processed some time after they were taken."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.angles import shortest_difference
from modular_framework_planning.geometry.spatial import Array

KEPT = 2000


class JointHistory:
    """The last KEPT joint positions with their times; not thread-safe."""

    def __init__(self, endless: NDArray[np.bool_]) -> None:
        """Begins without positions.

        Args:
            endless: whether a joint turns without end, shape (joints,): a sensor may jump by a turn, the joint cannot.
        """
        self._endless = endless
        self._times: deque[float] = deque(maxlen=KEPT)
        self._positions: deque[Array] = deque(maxlen=KEPT)

    def add(self, stamp_s: float, positions: Array) -> None:
        """Stores positions [rad or m]; a time before the last one means a reset clock, and clears the history."""
        if self._times and stamp_s < self._times[-1] - 1.0:
            self._times.clear()
            self._positions.clear()
        if self._times and stamp_s <= self._times[-1]:
            self._positions[-1] = positions  # with several sources, the last message includes all joints known so far
            return
        self._times.append(stamp_s)
        self._positions.append(positions)

    def covers(self, stamp_s: float) -> bool:
        """Whether positions at that time, or later ones, are known."""
        return bool(self._times) and self._times[-1] >= stamp_s

    def at(self, stamp_s: float) -> Array:
        """Returns the positions at a time, interpolated; joints without ends turn by the short way.

        Raises:
            PlanningError: the time is later than the last known one, or earlier than the first.
        """
        if not self._times or not self._times[0] <= stamp_s <= self._times[-1]:
            known = f"{self._times[0]:.3f} to {self._times[-1]:.3f} s" if self._times else "none"
            raise PlanningError(
                ErrorCode.ROBOT_STATE_STALE,
                f"joint positions at {stamp_s:.3f} s: known times are "
                f"{known}; is joint_states published, and do its stamps and the sensor's come from one "
                "clock?",
            )
        after = bisect_left(self._times, stamp_s)
        if self._times[after] == stamp_s:
            return self._positions[after]
        first, last = self._times[after - 1], self._times[after]
        share = (stamp_s - first) / (last - first)
        begin = self._positions[after - 1]
        return begin + share * shortest_difference(self._positions[after] - begin, self._endless)
