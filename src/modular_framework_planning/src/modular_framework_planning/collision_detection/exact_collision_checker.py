# SPDX-License-Identifier: BSD-3-Clause
"""The default collision checker: compiled distance bounds first, then Coal's exact check of undecided pairs.

A state is free only if the bounds or Coal prove that every pair of bodies is apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.collision_bodies import (
    Joints,
    PlacedGeometry,
    WatchedPairs,
    placed_geometries,
    watched_pairs,
)
from modular_framework_planning.collision_detection.collision_world import CompiledWorld, compile_world
from modular_framework_planning.collision_detection.exact_collision import ExactCollision
from modular_framework_planning.collision_detection.kernels.compiled_collision import (
    EXACTLY_TOUCHING,
    FOUND_FREE,
    REQUESTED,
    World,
    surrounded_pair_at,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import TOO_CLOSE, TOUCHING
from modular_framework_planning.collision_detection.kernels.compiled_paths import (
    INITIAL_UNDECIDED_ROWS,
    check_polyline,
    sample_at,
)
from modular_framework_planning.collision_detection.kernels.compiled_penetration import (
    BoundingSpheres,
    bounding_spheres_of,
    penetrations,
)
from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.plan_statistics import Refusals
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel

DEPTH_TOLERANCE_M = 2.0e-4  # numerical noise in the depth of a tolerated contact
EXACT_STEP = 4.0e-3  # [rad or m]; sample spacing for pairs that only the exact check can decide


class ExactCollisionChecker:
    """Checks states and paths of the robot in one snapshot of the scene.

    Not thread-safe, because the checker holds working memory. Path and state checks skip pairs whose relative pose the
    moving joints cannot change; `fixed_contacts` checks these pairs.
    """

    def __init__(
        self,
        scene: PlanningScene,
        moving: Joints = None,
        tolerated: Sequence[Contact] = (),
    ) -> None:
        """Builds the checker.

        Args:
            scene: Snapshot of the planning scene.
            moving: Indices of the joints that will move; None for all joints.
            tolerated: Contacts of held bodies that may remain but not deepen.
        """
        self.model: RobotModel = scene.model
        self._parts: list[PlacedGeometry] = placed_geometries(scene)
        self._pairs: WatchedPairs = watched_pairs(scene, self._parts, moving)
        depths = {frozenset((item.first.name, item.second.name)): item.depth for item in tolerated}
        self._tolerated: dict[int, float] = {}
        for index in self._pairs.moving_indices.tolist() if depths else ():
            depth = depths.get(frozenset(self._names(index)))
            if depth is not None:
                self._tolerated[index] = depth
        self._moving, self._moving_pairs = self._pairs.moving_indices, self._pairs.moving
        if self._tolerated:
            self._moving = np.setdiff1d(self._moving, list(self._tolerated))
            self._moving_pairs = self._pairs.subset(self._moving)
        self._undecided = np.empty((INITIAL_UNDECIDED_ROWS, 2), dtype=np.int64)

    @cached_property
    def _exact(self) -> ExactCollision:
        return ExactCollision(self.model, self._parts, self._pairs)

    @cached_property
    def _compiled(self) -> CompiledWorld:
        return compile_world(self.model, self._parts, self._moving_pairs)

    @property
    def compiled_world(self) -> World | None:
        """The world for `compiled_paths.check_path`.

        None if a pair needs the exact check at every state, or if a subclass overrides `path_is_free`.
        """
        is_overridden = type(self).path_is_free is not ExactCollisionChecker.path_is_free
        return None if is_overridden or self._tolerated or self._compiled.uncompiled else self._compiled.world

    @property
    def check_counts(self) -> NDArray[np.int64]:
        """Counters of checks, see the protocol CountsChecks."""
        return self._compiled.world.counts

    def most_frequent_contact(self) -> Refusals | None:
        """Returns the two bodies that touched in the most checks, or None if no bodies touched."""
        refusals = self._compiled.world.refusals
        pair = int(refusals.argmax()) if len(refusals) else -1
        if pair < 0 or not refusals[pair]:
            return None
        return Refusals(*self._names(self._moving[self._compiled.members[pair][0]]), int(refusals[pair]))

    def _names(self, pair_index: int) -> tuple[str, str]:
        pair = self._pairs[pair_index]
        return self._parts[pair.first].body.name, self._parts[pair.second].body.name

    def build(self, check_interrupt: Callable[[], None]) -> None:
        """Builds the arrays and sphere trees, which takes seconds for 100,000 triangles.

        Args:
            check_interrupt: Function called between shapes; raises an exception to stop. Finished shapes stay cached.
        """
        self._compiled = compile_world(self.model, self._parts, self._moving_pairs, check_interrupt)

    def is_free(self, positions: Array) -> bool:
        """Returns whether no moving pair touches at these joint positions of the whole robot."""
        return self.path_is_free(np.asarray(positions, dtype=float)[None, :], 1.0)

    def path_is_free(self, vertices: Array, step: float, first: int = 0) -> bool:
        """Returns whether all samples of a polyline are free.

        Args:
            vertices: Joint positions of the whole robot, shape (n, joints) [rad or m].
            step: Maximum joint distance between samples [rad or m].
            first: Index of the first checked sample; 1 skips the first vertex.
        """
        return self._colliding_sample(np.ascontiguousarray(vertices, dtype=float), step, first)[0] < 0

    def colliding_state(self, vertices: Array, step: float) -> Array | None:
        """Returns a colliding state among the samples of `path_is_free`, or None."""
        path = np.ascontiguousarray(vertices, dtype=float)
        index, vertex_samples = self._colliding_sample(path, step, 0)
        return sample_at(path, vertex_samples, index) if index >= 0 else None

    def _colliding_sample(self, path: Array, step: float, first: int) -> tuple[int, NDArray[np.int64]]:
        """Returns the index of a colliding sample or -1, and the sample index of each vertex; see `path_is_free`."""
        status, count, vertex_samples = check_polyline(path, step, first, self._undecided, *self._compiled.arguments)
        decided = 0
        while status == TOO_CLOSE:
            written = min(count, len(self._undecided))
            index = self._decide(path, vertex_samples, self._undecided[decided:written])
            if index >= 0:
                return index, vertex_samples
            if written == count:
                break
            decided, self._undecided = written, np.empty((4 * written, 2), dtype=np.int64)
            self.check_counts[REQUESTED] -= 1  # the check was already counted
            status, count, vertex_samples = check_polyline(
                path, step, first, self._undecided, *self._compiled.arguments
            )
        if status == TOUCHING:
            return count, vertex_samples
        end = int(vertex_samples[-1])
        if self._tolerated or self._compiled.uncompiled:
            self.check_counts[FOUND_FREE] -= status != TOO_CLOSE  # pairs without bounds are still unchecked
            for index in (*range(end, first, -max(1, int(EXACT_STEP / step))), min(first, end)):
                if not self._unbounded_pairs_are_free(sample_at(path, vertex_samples, index)):
                    self.check_counts[EXACTLY_TOUCHING] += 1
                    return index, vertex_samples
        return -1, vertex_samples

    def _decide(self, path: Array, vertex_samples: NDArray[np.int64], undecided: NDArray[np.int64]) -> int:
        """Runs the exact check on undecided pairs and returns the index of a touching sample, or -1."""
        for index, pair in undecided.tolist():
            members = {int(self._moving[member]): member for member in self._compiled.members[pair]}
            touching = self._exact.touching_pair(sample_at(path, vertex_samples, index), members)
            if touching >= 0:
                self.check_counts[EXACTLY_TOUCHING] += 1
                self._compiled.world.refusals[self._compiled.members.row_of(members[touching])] += 1
                return index
        return -1

    def _unbounded_pairs_are_free(self, positions: Array) -> bool:
        """Returns whether tolerated contacts have not deepened and pairs without bounds are apart."""
        if self._exact.touching_pair(positions, (self._moving[index] for index in self._compiled.uncompiled)) >= 0:
            return False
        return all(
            contact.depth <= self._tolerated[index] + DEPTH_TOLERANCE_M
            for index, contact in self._exact.contacts(positions, self._tolerated)
        )

    def contacts(self, positions: Array, include_fixed: bool = True) -> list[Contact]:
        """Returns the deepest contact of every touching pair, deepest first.

        A body inside another body without touching its surface is reported only if no other pair touches.
        """
        pair_indices = np.flatnonzero(~self._pairs.fixed | include_fixed).tolist()
        found = [
            contact
            for index, contact in self._exact.contacts(positions, pair_indices)
            if index not in self._tolerated or contact.depth > self._tolerated[index] + DEPTH_TOLERANCE_M
        ]
        return sorted(found or self._surrounding_contacts(positions), key=lambda item: -item.depth)

    def _surrounding_contacts(self, positions: Array) -> list[Contact]:
        row = surrounded_pair_at(np.asarray(positions, dtype=float), *self._compiled.arguments)
        if row < 0:
            return []
        index = self._moving[self._compiled.members[row][0]]
        pair = self._pairs[index]
        first, second = self._parts[pair.first], self._parts[pair.second]
        depth = self._exact.distance(positions, [index])
        position = self._exact.position(positions, pair.second)
        return [Contact(first.body, second.body, depth, position, np.zeros(3))]

    def fixed_contacts(self, positions: Array) -> list[Contact]:
        """Returns the contacts of watched pairs whose relative pose the moving joints cannot change."""
        pair_indices = np.flatnonzero(self._pairs.fixed).tolist()
        return [contact for _, contact in self._exact.contacts(positions, pair_indices)] if pair_indices else []

    def distance(self, positions: Array) -> float:
        """Returns the minimum distance between bodies that may not touch [m], at most 0 in a collision."""
        return self._exact.distance(positions, range(len(self._pairs)))

    @cached_property
    def _bounding_spheres(self) -> BoundingSpheres:
        return bounding_spheres_of(self._compiled.world)

    def collision_costs(self, states: Array) -> Array:
        """Returns the sum of depth and TOUCH_COST_M over the touching pairs, shape (n,) [m], from bounding spheres.

        Args:
            states: Joint positions of the whole robot, shape (n, joints) [rad or m].
        """
        return np.asarray(penetrations(self._compiled.world, self._bounding_spheres, states))
