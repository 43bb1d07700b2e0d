# SPDX-License-Identifier: BSD-3-Clause
"""History of joint positions, for sensor data that are processed after their time stamp."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.angles import shortest_difference
from modular_framework_planning.geometry.spatial import Array

HISTORY_LENGTH = 2000


class JointHistory:
    """The last HISTORY_LENGTH joint positions with their times; not thread-safe."""

    def __init__(self, endless: NDArray[np.bool_]) -> None:
        """Creates an empty history.

        Args:
            endless: Whether each joint rotates without limits, so that measurements may jump by 2 pi; shape (joints,).
        """
        self._endless = endless
        self._times: deque[float] = deque(maxlen=HISTORY_LENGTH)
        self._positions: deque[Array] = deque(maxlen=HISTORY_LENGTH)

    def add(self, stamp_s: float, positions: Array) -> None:
        """Stores positions [rad or m].

        A stamp more than 1 s before the newest stamp clears the history, because the clock was reset.
        """
        if self._times and stamp_s < self._times[-1] - 1.0:
            self._times.clear()
            self._positions.clear()
        if self._times and stamp_s <= self._times[-1]:
            self._positions[-1] = positions  # the newest positions include the joints of all sources
            return
        self._times.append(stamp_s)
        self._positions.append(positions)

    def has_reached(self, stamp_s: float) -> bool:
        """Returns whether the newest positions are from this time or later."""
        return bool(self._times) and self._times[-1] >= stamp_s

    def positions_at(self, stamp_s: float) -> Array:
        """Returns interpolated positions at a time; continuous joints are interpolated along the shorter direction.

        Raises:
            PlanningError: The time is outside the history.
        """
        if not self._times or not self._times[0] <= stamp_s <= self._times[-1]:
            known = f"{self._times[0]:.3f} to {self._times[-1]:.3f} s" if self._times else "none"
            raise PlanningError(
                ErrorCode.ROBOT_STATE_STALE,
                f"joint positions at {stamp_s:.3f} s: known times are "
                f"{known}; is joint_states published, and do joint_states and the sensor use the same "
                "clock?",
            )
        after = bisect_left(self._times, stamp_s)
        if self._times[after] == stamp_s:
            return self._positions[after]
        first, last = self._times[after - 1], self._times[after]
        fraction = (stamp_s - first) / (last - first)
        before = self._positions[after - 1]
        return before + fraction * shortest_difference(self._positions[after] - before, self._endless)
