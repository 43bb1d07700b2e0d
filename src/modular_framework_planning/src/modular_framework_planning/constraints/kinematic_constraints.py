# SPDX-License-Identifier: BSD-3-Clause
"""Checks states against a set of constraints, projects states onto it, and samples states from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.constraints.constraint_kinds import (
    Constraint,
    ConstraintResult,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import RobotModel

MAX_STEP = 0.3  # [rad or m]; of any joint in one step of a projection
DAMPING = 1.0e-6
LOOSE = 0.02  # [m] or [rad]; tolerances above this are worth sampling in
Index = Sequence[int] | NDArray[np.int64]


class KinematicConstraints:
    """Constraints that must all hold at once.

    Not for use from two threads at a time: it holds the working memory of forward kinematics; `copy` gives another.
    Positions are those of the whole robot [rad or m].
    """

    def __init__(
        self,
        model: RobotModel,
        joints: Sequence[JointConstraint] = (),
        positions: Sequence[PositionConstraint] = (),
        orientations: Sequence[OrientationConstraint] = (),
        name: str = "",
    ) -> None:
        self.model = model
        self.name = name
        self.joints, self.positions, self.orientations = tuple(joints), tuple(positions), tuple(orientations)
        self._all: tuple[Constraint, ...] = (*self.joints, *self.positions, *self.orientations)
        self._data = model.pin_model.createData()

    @property
    def is_empty(self) -> bool:
        """Whether every state satisfies."""
        return not self._all

    def copy(self) -> KinematicConstraints:
        """Returns the same constraints with working memory of their own."""
        return KinematicConstraints(self.model, self.joints, self.positions, self.orientations, self.name)

    def evaluate(self, positions: Array) -> list[ConstraintResult]:
        """Returns one result a constraint: joints first, then positions, then orientations."""
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        return [item.evaluate(self._data, positions) for item in self._all]

    def satisfied(self, positions: Array) -> bool:
        """Whether a state keeps every constraint."""
        if not self._all:
            return True
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        return all(item.evaluate(self._data, positions).satisfied for item in self._all)

    def describe(self, positions: Array) -> str:
        """Says which constraints a state violates and by how much; empty where it keeps all."""
        return "; ".join(item.text for item in self.evaluate(positions) if not item.satisfied)

    @property
    def pose_link(self) -> str:
        """The link whose pose the constraints are about: one position and one orientation of it; else empty."""
        if self.joints or len(self.positions) != 1 or len(self.orientations) != 1:
            return ""
        name = self.positions[0].link.name
        return name if name == self.orientations[0].link.name else ""

    @property
    def is_loose(self) -> bool:
        """Whether quite different states satisfy, so that sampling around the middle of the tolerances pays."""
        return any(solid.extent > LOOSE for item in self.positions for solid, _ in item.regions) or any(
            float(item.tolerances.max()) > LOOSE for item in self.orientations
        )

    def pose_target(self, positions: Array, rng: np.random.Generator | None = None) -> Transform:
        """Returns a pose of `pose_link` in the planning frame that satisfies.

        Args:
            positions: state that says where moving frames are.
            rng: draws a random one; without it, it is the middle of the first region, turned as asked.
        """
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        point, turn = self.positions[0], self.orientations[0]
        number = 0 if rng is None else int(rng.integers(len(point.regions)))
        solid, pose = point.regions[number]
        at = (point.reference.pose(self._data) * pose).act(np.zeros(3) if rng is None else solid.sample(rng))
        inner = turn.target if rng is None else turn.sample(rng)
        rotation = turn.reference.pose(self._data).rotation @ inner
        return pin.SE3(rotation, at - rotation @ point.offset)

    def bounds(self, indices: Index, positions: Array) -> tuple[Array, Array]:
        """Returns the lower and upper values of the given joints that bounds and joint constraints leave.

        For a joint without ends it is the turn nearest to `positions`. Lower is above upper where nothing is left.
        """
        lower, upper = self.model.lower.copy(), self.model.upper.copy()
        for item in self.joints:
            target = float(positions[item.index]) - item.deviation(positions)
            lower[item.index] = max(lower[item.index], target - item.below)
            upper[item.index] = min(upper[item.index], target + item.above)
        chosen = np.asarray(indices, dtype=np.int64)
        return lower[chosen], upper[chosen]

    def project(self, positions: Array, indices: Index, steps: int = 60) -> Array | None:
        """Moves joints by least-squares steps until every constraint holds.

        Args:
            positions: where to begin.
            indices: the joints that may move, as indices in a position vector; mimic joints follow theirs.
            steps: how many steps to try.

        Returns:
            Positions within the joints' bounds that satisfy, or None where the steps did not get there.
        """
        chosen = np.asarray(indices, dtype=np.int64)
        lower, upper = self.bounds(chosen, positions)
        if (lower > upper).any():
            return None
        members = {int(number) for number in chosen}
        current = np.array(positions, dtype=float)
        current[chosen] = np.clip(current[chosen], lower, upper)
        for _ in range(steps):
            current = self.model.with_mimics(current, members)
            pin.computeJointJacobians(self.model.pin_model, self._data, current)
            found = [item.conditions(self.model.pin_model, self._data) for item in self._all]
            if not any(violated for violated, _ in found):
                return current if self.satisfied(current) else None
            rows = [row for _, conditions in found for row in conditions]
            rates = self._group_rates(np.array([row[0] for row in rows]), chosen)
            step = _bounded_step(rates, np.array([row[1] for row in rows]), current[chosen], lower, upper)
            current[chosen] = np.clip(current[chosen] + step, lower, upper)
        return None

    def _group_rates(self, rates: Array, indices: NDArray[np.int64]) -> Array:
        """Picks the columns of the moving joints; what mimic joints add goes to their leaders."""
        if self.model.mimics:
            rates = rates.copy()
            for follower, leader, multiplier, _ in self.model.mimics:
                rates[:, leader] += multiplier * rates[:, follower]
        return rates[:, indices]

    def sample(self, rng: np.random.Generator, positions: Array, indices: Index, attempts: int = 20) -> Array | None:
        """Returns a random state that satisfies: random joint values, then `project`; None after the attempts.

        Args:
            rng: source of random numbers.
            positions: where the joints that do not move are.
            indices: the joints that may move.
            attempts: how many random states to try.
        """
        chosen = np.asarray(indices, dtype=np.int64)
        lower, upper = self.bounds(chosen, positions)
        if (lower > upper).any():
            return None
        middle = np.clip(positions[chosen], lower, upper)
        low, high = np.maximum(lower, middle - 2.0 * np.pi), np.minimum(upper, middle + 2.0 * np.pi)
        for _ in range(attempts):
            state = np.array(positions, dtype=float)
            state[chosen] = rng.uniform(low, high)
            found = self.project(state, chosen)
            if found is not None:
                return found
        return None


def _bounded_step(rates: Array, wanted: Array, values: Array, lower: Array, upper: Array) -> Array:
    """Returns the damped least-squares step; joints it would push over a bound stay and the others take over."""
    free = np.ones(len(values), dtype=bool)
    step = np.zeros(len(values))
    for _ in range(3):
        active = rates * free
        damped = active @ active.T + DAMPING * np.eye(len(wanted))
        step = active.T @ np.linalg.solve(damped, wanted)
        step *= min(1.0, MAX_STEP / max(float(np.abs(step).max()), 1.0e-12))
        blocked = free & (((values <= lower) & (step < 0.0)) | ((values >= upper) & (step > 0.0)))
        if not blocked.any():
            break
        free &= ~blocked
    return step
