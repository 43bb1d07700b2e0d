# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of the states, edges and paths of a planning group."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_edges import GroupEdges
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker


class MotionChecker:
    """Checks motions of a group while all other joints stay at fixed positions.

    Attributes:
        checker: Collision checker of the scene.
    """

    def __init__(self, checker: CollisionChecker, indices: NDArray[np.int64], rest: Array) -> None:
        """Stores the checker and the group.

        Args:
            checker: Collision checker of the scene.
            indices: Indices of the group's joints.
            rest: Positions of the whole robot, used for the joints outside the group [rad or m].
        """
        self.checker = checker
        self._indices = indices
        self._rest = np.array(rest, dtype=float)
        self._state, self._edge = self._rest[None].copy(), np.tile(self._rest, (2, 1))
        self._group_map: tuple[Array, Array] | None = None  # see GroupEdges
        model = checker.model
        leaders = {int(index) for index in indices}
        self._mimic_leaders = leaders if any(leader in leaders for _, leader, _, _ in model.mimics) else set()

    def full_positions(self, values: Array) -> Array:
        """Returns the positions of the whole robot for a joint vector of the group."""
        result = self._rest.copy()
        result[self._indices] = values
        return self.checker.model.with_mimics(result, self._mimic_leaders) if self._mimic_leaders else result

    def edges(self, step: float) -> GroupEdges:
        """Returns the group's edge check for compiled loops, with a maximum joint displacement of `step` [rad or m]."""
        if self._group_map is None:
            rest = self.full_positions(np.zeros(len(self._indices)))
            columns = [self.full_positions(row) - rest for row in np.eye(len(self._indices))]
            self._group_map = rest, np.array(columns).T.copy()
        return GroupEdges(*self._group_map, step)

    def state_is_free(self, values: Array) -> bool:
        """Checks that a joint vector of the group is free of collisions."""
        if self._mimic_leaders:
            return self.checker.is_free(self.full_positions(values))
        self._state[0, self._indices] = values
        return self.checker.path_is_free(self._state, 1.0)

    def edge_is_free(self, start: Array, end: Array, step: float) -> bool:
        """Checks that a straight edge is free, including its end but not its start.

        Args:
            start: Joint vector of the group [rad or m].
            end: Joint vector of the group [rad or m].
            step: Maximum joint displacement between checked states [rad or m].
        """
        if self._mimic_leaders:
            return self.checker.path_is_free(self.full_path(np.array([start, end])), step, 1)
        edge = self._edge
        edge[0, self._indices], edge[1, self._indices] = start, end
        return self.checker.path_is_free(edge, step, 1)

    def polyline_is_free(self, polyline: Array, step: float) -> bool:
        """Checks that a polyline is free, including its start."""
        return self.checker.path_is_free(self.full_path(polyline), step)

    def colliding_state(self, polyline: Array, step: float) -> Array | None:
        """Returns a colliding state of a polyline, including its start, or None."""
        state = self.checker.colliding_state(self.full_path(polyline), step)
        return None if state is None else state[self._indices]

    def full_path(self, path: Array) -> Array:
        """Returns the positions of the whole robot for joint vectors of the group, shape (n, joints)."""
        if self._mimic_leaders:
            return np.array([self.full_positions(values) for values in path])
        result = np.empty((len(path), len(self._rest)))
        result[:] = self._rest
        result[:, self._indices] = path
        return result
