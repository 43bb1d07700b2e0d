# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of the states, edges and paths of a planning group."""

from __future__ import annotations

from functools import cached_property

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
        self.checker, self._indices, self._start = checker, indices, np.array(rest, dtype=float)

    @cached_property
    def _group_map(self) -> tuple[Array, Array]:
        """The attributes `rest` and `joint_map` of GroupEdges."""
        leaders = {int(index) for index in self._indices}
        rows = []
        for values in np.vstack([np.zeros(len(leaders)), np.eye(len(leaders))]):
            positions = self._start.copy()
            positions[self._indices] = values
            rows.append(self.checker.model.with_mimics(positions, leaders))
        return rows[0], np.ascontiguousarray((np.array(rows) - rows[0])[1:].T)

    def edges(self, step: float) -> GroupEdges:
        """Returns the group's edge check for compiled loops, with a maximum joint displacement of `step` [rad or m]."""
        return GroupEdges(*self._group_map, step)

    def full_path(self, path: Array) -> Array:
        """Returns the positions of the whole robot for joint vectors of the group, shape (n, joints)."""
        rest, joint_map = self._group_map
        return rest + path @ joint_map.T

    def full_positions(self, values: Array) -> Array:
        """Returns the positions of the whole robot for a joint vector of the group."""
        return self.full_path(values[None])[0]

    def state_is_free(self, values: Array) -> bool:
        """Checks that a joint vector of the group is free of collisions."""
        return self.checker.path_is_free(self.full_path(values[None]), 1.0)

    def edge_is_free(self, start: Array, end: Array, step: float) -> bool:
        """Checks that a straight edge is free, including its end but not its start.

        Args:
            start: Joint vector of the group [rad or m].
            end: Joint vector of the group [rad or m].
            step: Maximum joint displacement between checked states [rad or m].
        """
        return self.checker.path_is_free(self.full_path(np.array([start, end])), step, 1)

    def polyline_is_free(self, polyline: Array, step: float) -> bool:
        """Checks that a polyline is free, including its start."""
        return self.checker.path_is_free(self.full_path(polyline), step)

    def colliding_state(self, polyline: Array, step: float) -> Array | None:
        """Returns a colliding state of a polyline, including its start, or None."""
        state = self.checker.colliding_state(self.full_path(polyline), step)
        return None if state is None else state[self._indices]
