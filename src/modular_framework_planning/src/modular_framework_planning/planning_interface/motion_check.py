# SPDX-License-Identifier: BSD-3-Clause
"""Checks straight motions of one group: a whole edge or path per call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_edges import (
    BLOCKED,
    FREE,
    UNKNOWN,
    EdgeMemory,
    GroupEdges,
    new_memory,
    recall,
    remember,
)
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.trajectory_processing.compiled_polylines import pieces_on_edges

KNOWN_STEPS = 8  # a straight piece of fewer steps is checked again sooner than looked for among the free edges
ON_EDGE = 1.0e-8  # [rad or m]; a point that is no farther from an edge lies on it


class MotionChecker:
    """Checks joint vectors of one group; all other joints stay at given positions.

    Edges that were checked finely are remembered: what lies on a free one is not checked again.

    Attributes:
        memory: of these edges.
    """

    def __init__(
        self, checker: CollisionChecker, indices: NDArray[np.int64], rest: Array, remembered_step: float = 0.0
    ) -> None:
        """Stores the checker and the group.

        Args:
            checker: of the scene.
            indices: of the group's joints.
            rest: positions of the whole robot, for all other joints [rad or m].
            remembered_step: edges that are checked at such steps or finer ones are remembered [rad or m].
        """
        self._checker = checker
        self._indices = indices
        self._rest = np.array(rest, dtype=float)
        self._state, self._edge = self._rest[None].copy(), np.tile(self._rest, (2, 1))
        self._remembered_step = remembered_step
        self.memory: EdgeMemory = new_memory(len(indices))
        self._motions: tuple[Array, Array] | None = None  # see GroupEdges
        model = checker.model
        members = {int(number) for number in indices}
        self._members = members if any(leader in members for _, leader, _, _ in model.mimics) else set()

    def full_positions(self, values: Array) -> Array:
        """Returns positions of the whole robot for a joint vector of the group."""
        result = self._rest.copy()
        result[self._indices] = values
        return self._checker.model.with_mimics(result, self._members) if self._members else result

    def edges(self, step: float) -> GroupEdges:
        """Returns how compiled loops check straight motions at samples at most `step` [rad or m, any joint] apart."""
        if self._motions is None:
            rest = self.full_positions(np.zeros(len(self._indices)))
            columns = [self.full_positions(row) - rest for row in np.eye(len(self._indices))]
            self._motions = rest, np.array(columns).T.copy()
        return GroupEdges(*self._motions, step)

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
        if step > self._remembered_step:
            return self._edge_is_free(start, end, step)
        verdict = recall(self.memory, start, end, step)
        if verdict == UNKNOWN:
            verdict = FREE if self._edge_is_free(start, end, step) else BLOCKED
            remember(self.memory, start, end, step, verdict)
        return bool(verdict == FREE)

    def _edge_is_free(self, start: Array, end: Array, step: float) -> bool:
        if self._members:
            return self._checker.path_is_free(self.full_path(np.array([start, end])), step, 1)
        edge = self._edge
        edge[0, self._indices], edge[1, self._indices] = start, end
        return self._checker.path_is_free(edge, step, 1)

    def polyline_is_free(self, polyline: Array, step: float) -> bool:
        """Whether straight pieces are free (start included); free edges that are known are not looked for."""
        return self._checker.path_is_free(self.full_path(polyline), step)

    def colliding_state(self, polyline: Array, step: float) -> Array | None:
        """Returns a colliding sample along straight pieces (start included), or None."""
        for part in self._unchecked(polyline, step):
            found = self._checker.colliding_state(self.full_path(part), step)
            if found is not None:
                return found[self._indices]
        return None

    def _unchecked(self, polyline: Array, step: float) -> list[Array]:
        """Returns a polyline without its pieces on free edges; all of its vertices stay."""
        if step < self._remembered_step:
            return [polyline]
        is_free = self.memory.verdicts == FREE
        known = pieces_on_edges(np.ascontiguousarray(polyline), self.memory.ends, is_free, KNOWN_STEPS * step, ON_EDGE)
        return np.split(polyline, known + 1) if len(known) else [polyline]

    def full_path(self, path: Array) -> Array:
        """Returns positions of the whole robot for joint vectors of the group, shape (n, joints)."""
        if self._members:
            return np.array([self.full_positions(values) for values in path])
        result = np.empty((len(path), len(self._rest)))
        result[:] = self._rest
        result[:, self._indices] = path
        return result
