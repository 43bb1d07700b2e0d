# SPDX-License-Identifier: BSD-3-Clause
"""Checks states and motions for collisions: compiled bounds first, then Coal's exact check of undecided pairs.

A state counts as free only if the bounds prove every pair of bodies apart, or Coal does.
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
    ASKED,
    FOUND_FREE,
    TOUCHING_EXACTLY,
    World,
    surrounded_pair_at,
)
from modular_framework_planning.collision_detection.kernels.compiled_distance import TOO_CLOSE, TOUCHING
from modular_framework_planning.collision_detection.kernels.compiled_paths import (
    UNDECIDED_ROWS,
    check_polyline,
    sample_at,
)
from modular_framework_planning.collision_detection.kernels.compiled_penetration import Cover, cover_of, penetrations
from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.plan_statistics import Refusals
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel

DEPTH_SLACK = 2.0e-4  # [m]; how much deeper a tolerated contact may seem through numerical noise
EXACT_STEP = 4.0e-3  # [rad or m]; between samples of pairs that only the exact check can decide


class ExactCollisionChecker:
    """Checks states and paths of the robot in one snapshot of the scene.

    Not for use from two threads at a time: it holds the working memory of the check. Pairs whose relative pose the
    given joints cannot change are checked once, in `fixed_contacts`.
    """

    def __init__(
        self,
        scene: PlanningScene,
        moving: Joints = None,
        tolerated: Sequence[Contact] = (),
    ) -> None:
        """Builds the checker.

        Args:
            scene: the snapshot to check in.
            moving: joints that will move, as indices in a position vector; all by default.
            tolerated: contacts of held bodies that may stay but not deepen.
        """
        self.model: RobotModel = scene.model
        self._parts: list[PlacedGeometry] = placed_geometries(scene)
        self._pairs: WatchedPairs = watched_pairs(scene, self._parts, moving)
        depths = {frozenset((item.first.name, item.second.name)): item.depth for item in tolerated}
        self._tolerated: dict[int, float] = {}
        for number in self._pairs.moving_numbers.tolist() if depths else ():
            depth = depths.get(frozenset(self._names(number)))
            if depth is not None:
                self._tolerated[number] = depth
        self._moving, self._moving_pairs = self._pairs.moving_numbers, self._pairs.moving
        if self._tolerated:
            self._moving = np.setdiff1d(self._moving, list(self._tolerated))
            self._moving_pairs = self._pairs.chosen(self._moving)
        self._undecided = np.empty((UNDECIDED_ROWS, 2), dtype=np.int64)

    @cached_property
    def _exact(self) -> ExactCollision:
        return ExactCollision(self.model, self._parts, self._pairs)

    @cached_property
    def _compiled(self) -> CompiledWorld:
        return compile_world(self.model, self._parts, self._moving_pairs)

    @property
    def compiled_world(self) -> World | None:
        """The world as `compiled_paths.check_path` takes it.

        None where pairs need the exact check at every state, and for a subclass with a `path_is_free` of its own.
        """
        is_own = type(self).path_is_free is not ExactCollisionChecker.path_is_free
        return None if is_own or self._tolerated or self._compiled.uncompiled else self._compiled.world

    @property
    def check_counts(self) -> NDArray[np.int64]:
        """See the protocol CountsChecks."""
        return self._compiled.world.counts

    def most_refusals(self) -> Refusals | None:
        """Returns the two bodies that touched in the most checks; None where none did."""
        refusals = self._compiled.world.refusals
        pair = int(refusals.argmax()) if len(refusals) else -1
        if pair < 0 or not refusals[pair]:
            return None
        return Refusals(*self._names(self._moving[self._compiled.members[pair][0]]), int(refusals[pair]))

    def _names(self, number: int) -> tuple[str, str]:
        pair = self._pairs[number]
        return self._parts[pair.first].body.name, self._parts[pair.second].body.name

    def build(self, check_interrupt: Callable[[], None]) -> None:
        """Builds now what the first check would build: it takes seconds for 100,000 triangles.

        Args:
            check_interrupt: called between shapes; raises an exception to stop. What was built is kept.
        """
        self._compiled = compile_world(self.model, self._parts, self._moving_pairs, check_interrupt)

    def is_free(self, positions: Array) -> bool:
        """Whether no pair that can move touches at these positions (of the whole robot)."""
        return self.path_is_free(np.asarray(positions, dtype=float)[None, :], 1.0)

    def path_is_free(self, vertices: Array, step: float, first: int = 0) -> bool:
        """Whether the straight pieces between states are free at samples at most `step` apart in every joint.

        Args:
            vertices: positions of the whole robot, shape (n, joints) [rad or m].
            step: distance of the samples [rad or m].
            first: number of the first sample that has to be free: 1 leaves the first vertex out.
        """
        return self._colliding_sample(np.ascontiguousarray(vertices, dtype=float), step, first)[0] < 0

    def colliding_state(self, vertices: Array, step: float) -> Array | None:
        """Returns a colliding sample along straight pieces, at the samples of path_is_free, or None."""
        path = np.ascontiguousarray(vertices, dtype=float)
        number, numbers = self._colliding_sample(path, step, 0)
        return sample_at(path, numbers, number) if number >= 0 else None

    def _colliding_sample(self, path: Array, step: float, first: int) -> tuple[int, NDArray[np.int64]]:
        """Returns the number of a colliding sample or -1, and the numbers of the samples at the vertices."""
        status, count, numbers = check_polyline(path, step, first, self._undecided, *self._compiled.arguments)
        decided = 0
        while status == TOO_CLOSE:
            written = min(count, len(self._undecided))
            number = self._decide(path, numbers, self._undecided[decided:written])
            if number >= 0:
                return number, numbers
            if written == count:
                break
            decided, self._undecided = written, np.empty((4 * written, 2), dtype=np.int64)
            self.check_counts[ASKED] -= 1  # the same check again
            status, count, numbers = check_polyline(path, step, first, self._undecided, *self._compiled.arguments)
        if status == TOUCHING:
            return count, numbers
        end = int(numbers[-1])
        if self._tolerated or self._compiled.uncompiled:
            self.check_counts[FOUND_FREE] -= status != TOO_CLOSE  # the bounds of the other pairs alone do not decide
            for number in (*range(end, first, -max(1, int(EXACT_STEP / step))), min(first, end)):
                if not self._rest_is_free(sample_at(path, numbers, number)):
                    self.check_counts[TOUCHING_EXACTLY] += 1
                    return number, numbers
        return -1, numbers

    def _decide(self, path: Array, numbers: NDArray[np.int64], undecided: NDArray[np.int64]) -> int:
        """Asks the exact check about (sample, pair) rows; returns the number of a sample that touches, or -1."""
        for number, pair in undecided.tolist():
            members = {int(self._moving[member]): member for member in self._compiled.members[pair]}
            touching = self._exact.touching_pair(sample_at(path, numbers, number), members)
            if touching >= 0:
                self.check_counts[TOUCHING_EXACTLY] += 1
                self._compiled.world.refusals[self._compiled.members.row_of(members[touching])] += 1
                return number
        return -1

    def _rest_is_free(self, positions: Array) -> bool:
        """Whether tolerated contacts stay shallow and pairs without bounds apart."""
        if self._exact.touching_pair(positions, (self._moving[number] for number in self._compiled.uncompiled)) >= 0:
            return False
        return all(
            contact.depth <= self._tolerated[number] + DEPTH_SLACK
            for number, contact in self._exact.contacts(positions, self._tolerated)
        )

    def contacts(self, positions: Array, include_fixed: bool = True) -> list[Contact]:
        """Returns every pair that touches, the deepest contact of each, deepest pair first.

        A body wholly inside another one, touching none of its surface, is reported only where no other pair touches.
        """
        numbers = np.flatnonzero(~self._pairs.fixed | include_fixed).tolist()
        found = [
            contact
            for number, contact in self._exact.contacts(positions, numbers)
            if number not in self._tolerated or contact.depth > self._tolerated[number] + DEPTH_SLACK
        ]
        return sorted(found or self._surrounded(positions), key=lambda item: -item.depth)

    def _surrounded(self, positions: Array) -> list[Contact]:
        number = surrounded_pair_at(np.asarray(positions, dtype=float), *self._compiled.arguments)
        if number < 0:
            return []
        inner = self._moving[self._compiled.members[number][0]]
        pair = self._pairs[inner]
        first, second = self._parts[pair.first], self._parts[pair.second]
        depth = self._exact.distance(positions, [inner])
        position = self._exact.position(positions, pair.second)
        return [Contact(first.body, second.body, depth, position, np.zeros(3))]

    def fixed_contacts(self, positions: Array) -> list[Contact]:
        """Returns contacts of watched pairs the moving joints cannot change."""
        numbers = np.flatnonzero(self._pairs.fixed).tolist()
        return [contact for _, contact in self._exact.contacts(positions, numbers)] if numbers else []

    def distance(self, positions: Array) -> float:
        """Returns the smallest distance [m] between bodies that may not touch; 0 or less when they do."""
        return self._exact.distance(positions, range(len(self._pairs)))

    @cached_property
    def _cover(self) -> Cover:
        return cover_of(self._compiled.world)

    def collision_costs(self, states: Array) -> Array:
        """Returns the sum of depth and TOUCH_COST_M over the pairs that touch [m], from spheres around the bodies.

        Args:
            states: positions of the whole robot, shape (n, joints); costs have shape (n,).
        """
        return np.asarray(penetrations(self._compiled.world, self._cover, states))
