# SPDX-License-Identifier: BSD-3-Clause
"""Checks straight motions of one group: a whole edge or path per call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker


class MotionChecker:
    """Checks joint vectors of one group; all other joints stay at given positions."""

    def __init__(self, checker: CollisionChecker, indices: NDArray[np.int64], rest: Array) -> None:
        """Stores the checker and the group.

        Args:
            checker: of the scene.
            indices: of the group's joints.
            rest: positions of the whole robot, for all other joints [rad or m].
        """
        self._checker = checker
        self._indices = indices
        self._rest = np.array(rest, dtype=float)
        self._state, self._edge = self._rest[None].copy(), np.tile(self._rest, (2, 1))
        model = checker.model
        members = {int(number) for number in indices}
        self._members = members if any(leader in members for _, leader, _, _ in model.mimics) else set()

    def full_positions(self, values: Array) -> Array:
        """Returns positions of the whole robot for a joint vector of the group."""
        result = self._rest.copy()
        result[self._indices] = values
        return self._checker.model.with_mimics(result, self._members) if self._members else result

    def state_is_free(self, values: Array) -> bool:
        """Whether the state is free of collisions."""
        if self._members:
            return self._checker.is_free(self.full_positions(values))
        self._state[0, self._indices] = values
        return self._checker.path_is_free(self._state, 1.0)

    def edge_is_free(self, start: Array, end: Array, step: float) -> bool:
        """Whether the straight motion is free at samples at most `step` [rad or m, any joint] apart.

        The end is checked, the start is not.
        """
        if self._members:
            return self._checker.path_is_free(self.full_path(np.array([start, end])), step, 1)
        edge = self._edge
        edge[0, self._indices], edge[1, self._indices] = start, end
        return self._checker.path_is_free(edge, step, 1)

    def colliding_state(self, polyline: Array, step: float) -> Array | None:
        """Returns a colliding sample along straight pieces (start included), or None."""
        found = self._checker.colliding_state(self.full_path(polyline), step)
        return None if found is None else found[self._indices]

    def full_path(self, path: Array) -> Array:
        """Returns positions of the whole robot for joint vectors of the group, shape (n, joints)."""
        if self._members:
            return np.array([self.full_positions(values) for values in path])
        result = np.empty((len(path), len(self._rest)))
        result[:] = self._rest
        result[:, self._indices] = path
        return result
