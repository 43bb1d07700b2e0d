# SPDX-License-Identifier: BSD-3-Clause
"""Checks straight motions of one group: a whole edge or path per call."""
from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision import CollisionChecker
from modular_framework_planning.spatial import Array


class MotionChecker:
    """Answers for joint vectors of one group while the rest of the robot stays at given positions."""

    def __init__(self, checker: CollisionChecker, indices: NDArray[np.int64], rest: Array) -> None:
        """Args: the checker to ask; places of the group's joints; positions of the whole robot for all others."""
        self._checker = checker
        self._indices = indices
        self._rest = np.array(rest, dtype=float)
        model = checker.model
        members = {int(number) for number in indices}
        self._members = members if any(leader in members for _, leader, _, _ in model.mimics) else set()

    def whole(self, values: Array) -> Array:
        """Returns positions of the whole robot for a joint vector of the group."""
        result = self._rest.copy()
        result[self._indices] = values
        return self._checker.model.with_mimics(result, self._members) if self._members else result

    def state_is_free(self, values: Array) -> bool:
        """Whether the state is free of collisions."""
        return self._checker.is_free(self.whole(values))

    def edge_is_free(self, start: Array, end: Array, step: float) -> bool:
        """Whether the straight motion is free at samples at most `step` [rad or m, any joint] apart.

        The start itself is not looked at, the end is.
        """
        return self._checker.path_is_free(self.whole_path(np.array([start, end])), step, 1)

    def first_collision(self, polyline: Array, step: float) -> Array | None:
        """Returns the first colliding sample along straight pieces (start included), or None."""
        if self._checker.path_is_free(self.whole_path(polyline), step):
            return None
        if not self.state_is_free(polyline[0]):
            return polyline[0]
        for start, end in zip(polyline[:-1], polyline[1:], strict=True):
            if self.edge_is_free(start, end, step):
                continue
            count = max(1, int(np.ceil(float(np.abs(end - start).max()) / step)))
            for number in range(1, count + 1):
                values = start + number / count * (end - start)
                if not self.state_is_free(values):
                    return values
        return None

    def whole_path(self, path: Array) -> Array:
        """Returns positions of the whole robot for joint vectors of the group, shape (n, joints)."""
        if self._members:
            return np.array([self.whole(values) for values in path])
        result = np.empty((len(path), len(self._rest)))
        result[:] = self._rest
        result[:, self._indices] = path
        return result
