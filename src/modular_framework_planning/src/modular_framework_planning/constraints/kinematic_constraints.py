# SPDX-License-Identifier: BSD-3-Clause
"""Checks states against a set of constraints, projects states onto it, and samples states from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import (
    Conditions,
    Drive,
    edges_hold,
    first_violated,
    project,
)
from modular_framework_planning.constraints.condition_arrays import arrays_of, drive_of, whole_drive
from modular_framework_planning.constraints.constraint_kinds import (
    Constraint,
    ConstraintResult,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import RobotModel

LOOSE = 0.02  # [m] or [rad]; tolerances above this are worth sampling in
Index = Sequence[int] | NDArray[np.int64]


class KinematicConstraints:
    """Constraints that must all hold at once.

    Not for use from two threads at a time: it holds the working memory of forward kinematics.
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

    @cached_property
    def arrays(self) -> tuple[Conditions, NDArray[np.int64]]:
        """The constraints as compiled loops take them, and the indices in a position vector of their joints."""
        return arrays_of(self.model, self.joints, self.positions, self.orientations)

    @cached_property
    def _whole(self) -> Drive:
        return whole_drive(self.arrays[1])

    def evaluate(self, positions: Array) -> list[ConstraintResult]:
        """Returns one result a constraint: joints first, then positions, then orientations."""
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        return [item.evaluate(self._data, positions) for item in self._all]

    def satisfied(self, positions: Array) -> bool:
        """Whether a state keeps every constraint."""
        return self.first_violated(np.asarray(positions, dtype=float)[None]) < 0

    def first_violated(self, states: Array) -> int:
        """Returns the number of the first of some states (n, joints) that violates a constraint; -1 for none."""
        return int(first_violated(self.arrays[0], self._whole, np.ascontiguousarray(states, dtype=float)))

    def edges_hold(self, vertices: Array, step: float) -> bool:
        """Whether straight motions keep every constraint, their start left out.

        Args:
            vertices: positions of the whole robot, shape (n, joints).
            step: most distance of the samples that are looked at, in any joint [rad or m].
        """
        return bool(edges_hold(self.arrays[0], self._whole, np.ascontiguousarray(vertices, dtype=float), step))

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
        values = np.clip(current[chosen], lower, upper)
        if not project(
            self.arrays[0], drive_of(self.model, self.arrays[1], chosen, current), values, lower, upper, steps
        ):
            return None
        current[chosen] = values
        return self.model.with_mimics(current, members)

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
