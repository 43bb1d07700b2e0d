# SPDX-License-Identifier: BSD-3-Clause
"""The interface of every collision checker, used by planners, adapters and services."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.collision_detection.kernels.compiled_collision import World
from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.plan_statistics import Refusals
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel


class CollisionChecker(Protocol):
    """Checks states and paths of the robot in one snapshot of the scene; belongs to one thread.

    Two bodies are checked unless the scene's allowed collision matrix allows them to touch, they hang on the same
    joint, or one is a link that the other, a held object, may touch (`touch_links`). Bodies of the robot keep the
    scene's padding from the world: nearer than that counts as touching. A body wholly inside a closed one, whose
    surfaces do not touch, may count as touching at single states; the shipped checker does so. Pairs whose relative
    pose the moving joints cannot change are left out of all answers, unless a method says otherwise.

    Positions are those of the whole robot, in the order of `model.joint_names`, mimic joints included [rad or m].
    `path_is_free` is called some thousand times a plan; the other methods rarely.
    """

    @property
    def model(self) -> RobotModel:
        """The robot."""
        ...

    def build(self, check_interrupt: Callable[[], None]) -> None:
        """Builds now what the first check would have to build, which may take long.

        Args:
            check_interrupt: called now and then; raises an exception to stop.
        """
        ...

    def is_free(self, positions: Array) -> bool:
        """Whether no pair touches in this state, shape (joints,)."""
        ...

    def path_is_free(self, vertices: Array, step: float, first: int = 0) -> bool:
        """Whether the straight pieces between states are free at samples at most `step` apart in every joint.

        A piece of length d (of the joint that moves farthest) has ceil(d / step) samples behind its start, evenly
        spaced, its end included.

        Args:
            vertices: shape (n, joints), n at least 1. It may be working memory of the caller: keep no reference.
            step: above 0 [rad or m].
            first: number of the first sample that has to be free: 1 leaves the first vertex out.
        """
        ...

    def colliding_state(self, vertices: Array, step: float) -> Array | None:
        """Returns a colliding sample, shape (joints,), of those that path_is_free checks; None where all are free."""
        ...

    def contacts(self, positions: Array, include_fixed: bool = True) -> list[Contact]:
        """Returns every pair that touches in a state, the deepest contact of each, deepest pair first.

        Args:
            positions: shape (joints,).
            include_fixed: whether pairs that the moving joints cannot change count, too.
        """
        ...

    def fixed_contacts(self, positions: Array) -> list[Contact]:
        """Returns the contacts of the pairs alone that the moving joints cannot change."""
        ...

    def distance(self, positions: Array) -> float:
        """Returns the smallest distance [m] of all checked pairs, padding not counted, fixed pairs included.

        0 or less where bodies touch, infinite where no pair is checked.
        """
        ...


class CollisionCheckerFactory(Protocol):
    """Makes checkers; mostly the checker's class itself. Threads share it."""

    def __call__(
        self,
        scene: PlanningScene,
        moving: Sequence[int] | NDArray[np.int64] | None = None,
        tolerated: Sequence[Contact] = (),
    ) -> CollisionChecker:
        """Makes the checker of a scene.

        Args:
            scene: the snapshot to check in.
            moving: joints that will move, as indices in a position vector (their mimics follow); None for all.
            tolerated: contacts that may stay but not deepen; their pairs touch only where they are deeper than that.

        Raises:
            PlanningError: a shape cannot be checked.
        """
        ...


@runtime_checkable
class CollisionCostEstimator(Protocol):
    """An optional method of checkers for optimisers (STOMP), which otherwise use the slower `contacts`."""

    def collision_costs(self, states: Array) -> Array:
        """Returns smooth collision costs of states, shape (n,), as a guide for an optimiser; not a collision check.

        The cost is the sum of depth and TOUCH_COST_M over the pairs that touch [m], and 0 where none does.

        Args:
            states: shape (n, joints).
        """
        ...


class CompiledChecks(Protocol):
    """An optional property of checkers for searches that are compiled; without it they call `path_is_free`."""

    @property
    def compiled_world(self) -> World | None:
        """The world as `compiled_paths.check_path` takes it; None where some pair needs more than that knows."""
        ...


@runtime_checkable
class CountsChecks(Protocol):
    """An optional part of checkers, for reports about plans."""

    @property
    def check_counts(self) -> NDArray[np.int64]:
        """What was counted since the checker was made, see `compiled_collision.CHECK_COUNTS`; it counts on in place."""
        ...

    def most_refusals(self) -> Refusals | None:
        """Returns the two bodies that touched in the most checks; None where none did."""
        ...
