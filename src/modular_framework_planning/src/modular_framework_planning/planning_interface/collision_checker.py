# SPDX-License-Identifier: BSD-3-Clause
"""Collision checker interface, used by planners, request adapters and services."""

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
    """Checks states and paths of the robot in a snapshot of the scene; an instance belongs to one thread.

    A pair of bodies is checked unless the allowed collision matrix allows their contact, both move with the same
    joint, or one is an attached object and the other one of its `touch_links`. Robot bodies closer to the world than
    the padding of the scene count as touching. A body completely inside a closed body may count as touching in
    `is_free`, as in the default checker. Methods ignore fixed pairs, whose relative pose the moving joints cannot
    change, unless stated otherwise.

    Positions have the order of `model.joint_names`, including mimic joints [rad or m]. `path_is_free` is called
    thousands of times per plan, the other methods rarely.
    """

    @property
    def model(self) -> RobotModel:
        """Robot model."""
        ...

    def build(self, check_interrupt: Callable[[], None]) -> None:
        """Builds the data structures of the first check in advance, which can take long.

        Args:
            check_interrupt: Function called regularly; it raises an exception to stop the build.
        """
        ...

    def is_free(self, positions: Array) -> bool:
        """Checks that no pair touches in a state of shape (joints,)."""
        ...

    def path_is_free(self, vertices: Array, step: float, first: int = 0) -> bool:
        """Checks that the straight edges between states are free.

        An edge on which the fastest joint moves by d is checked at ceil(d / step) evenly spaced states after its start,
        including its end.

        Args:
            vertices: States of the robot, shape (n, joints), n >= 1. Keep no reference, the caller reuses the array.
            step: Maximum joint displacement between checked states, above 0 [rad or m].
            first: Index of the first checked state; 1 skips the first vertex.
        """
        ...

    def colliding_state(self, vertices: Array, step: float) -> Array | None:
        """Returns a colliding state among the states that path_is_free checks, shape (joints,), or None."""
        ...

    def contacts(self, positions: Array, include_fixed: bool = True) -> list[Contact]:
        """Returns the deepest contact of every touching pair, deepest first.

        Args:
            positions: State of the robot, shape (joints,).
            include_fixed: Whether to include fixed pairs.
        """
        ...

    def fixed_contacts(self, positions: Array) -> list[Contact]:
        """Returns the contacts of the fixed pairs only."""
        ...

    def distance(self, positions: Array) -> float:
        """Returns the minimum distance of all checked pairs, without padding and including fixed pairs [m].

        The distance is 0 or negative if bodies touch, and infinite if no pair is checked.
        """
        ...


class CollisionCheckerFactory(Protocol):
    """Creates checkers, usually the checker class itself; shared by threads."""

    def __call__(
        self,
        scene: PlanningScene,
        moving: Sequence[int] | NDArray[np.int64] | None = None,
        tolerated: Sequence[Contact] = (),
    ) -> CollisionChecker:
        """Returns the checker of a scene.

        Args:
            scene: Snapshot of the planning scene.
            moving: Indices of the moving joints in a position vector, without mimic joints; None for all joints.
            tolerated: Existing contacts. Their pairs count as touching only if the contact becomes deeper.

        Raises:
            PlanningError: A shape cannot be checked.
        """
        ...


@runtime_checkable
class CollisionCostEstimator(Protocol):
    """Optional method of checkers for optimisers such as STOMP, which otherwise use the slower `contacts`."""

    def collision_costs(self, states: Array) -> Array:
        """Returns smooth collision costs of states, shape (n,), which guide an optimiser but are no collision check.

        The cost is the sum of penetration depth and TOUCH_COST_M over the touching pairs [m].

        Args:
            states: States of the robot, shape (n, joints).
        """
        ...


class CompiledChecks(Protocol):
    """Optional property of checkers for compiled searches; without it, searches call `path_is_free`."""

    @property
    def compiled_world(self) -> World | None:
        """World for `compiled_paths.check_path`; None if compiled checks do not cover all pairs."""
        ...


@runtime_checkable
class CountsChecks(Protocol):
    """Optional part of checkers that counts checks for planning statistics."""

    @property
    def check_counts(self) -> NDArray[np.int64]:
        """Counts since the creation of the checker, see `compiled_collision.CHECK_COUNTS`; updated in place."""
        ...

    def most_frequent_contact(self) -> Refusals | None:
        """Returns the pair of bodies that touched in most checks, or None."""
        ...
