# SPDX-License-Identifier: BSD-3-Clause
"""Sets of kinematic constraints: checks, projection and sampling of states."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import (
    ConstraintArrays,
    JointMapping,
    edges_satisfied,
    first_violated,
    pose_deviations,
    project,
)
from modular_framework_planning.constraints.constraint_arrays import (
    constraint_arrays,
    full_joint_mapping,
    joint_mapping,
)
from modular_framework_planning.constraints.constraint_kinds import (
    ConstraintResult,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.robot_model.robot_model import RobotModel

LOOSE_TOLERANCE = 0.02  # larger tolerances are worth sampling [m or rad]
Index = Sequence[int] | NDArray[np.int64]


class KinematicConstraints:
    """A set of constraints that must all be satisfied.

    Positions are positions of the whole robot [rad or m]. Not thread-safe, because instances hold the working memory of
    forward kinematics.
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
        self._data = model.pin_model.createData()

    @property
    def is_empty(self) -> bool:
        """Whether the set has no constraint."""
        return not (self.joints or self.positions or self.orientations)

    @cached_property
    def arrays(self) -> tuple[ConstraintArrays, NDArray[np.int64]]:
        """Constraints as arrays, and the indices in a position vector of the constrained joints."""
        return constraint_arrays(self.model, self.joints, self.positions, self.orientations)

    @cached_property
    def _full_mapping(self) -> JointMapping:
        return full_joint_mapping(self.arrays[1])

    def evaluate(self, positions: Array) -> list[ConstraintResult]:
        """Returns the result of each constraint, in the order joints, positions, orientations."""
        state = np.ascontiguousarray(positions, dtype=float)
        excesses, deviations = pose_deviations(self.arrays[0], self._full_mapping, state)
        poses: list[PositionConstraint | OrientationConstraint] = [*self.positions, *self.orientations]
        results = [
            item.result(excess, deviation)
            for item, excess, deviation in zip(poses, excesses.tolist(), deviations, strict=True)
        ]
        return [*(item.evaluate(state) for item in self.joints), *results]

    def are_satisfied(self, positions: Array) -> bool:
        """Checks that a state satisfies all constraints."""
        return self.first_violated(np.asarray(positions, dtype=float)[None]) < 0

    def first_violated(self, states: Array) -> int:
        """Returns the index of the first state in (n, joints) that violates a constraint, or -1."""
        return int(first_violated(self.arrays[0], self._full_mapping, np.ascontiguousarray(states, dtype=float)))

    def edges_satisfied(self, vertices: Array, step: float) -> bool:
        """Checks that a polyline satisfies all constraints; its start is not checked.

        Args:
            vertices: Positions of the whole robot, shape (n, joints).
            step: Maximum joint displacement between checked states [rad or m].
        """
        return bool(
            edges_satisfied(self.arrays[0], self._full_mapping, np.ascontiguousarray(vertices, dtype=float), step)
        )

    def describe(self, positions: Array) -> str:
        """Returns a description of the violated constraints, empty if there are none."""
        return "; ".join(item.text for item in self.evaluate(positions) if not item.satisfied)

    @property
    def pose_link(self) -> str:
        """Name of the link that is constrained by exactly one position and one orientation, otherwise empty."""
        if self.joints or len(self.positions) != 1 or len(self.orientations) != 1:
            return ""
        name = self.positions[0].link.name
        return name if name == self.orientations[0].link.name else ""

    @property
    def is_loose(self) -> bool:
        """Whether the tolerances are large enough to sample in."""
        return any(solid.extent > LOOSE_TOLERANCE for item in self.positions for solid, _ in item.regions) or any(
            float(item.tolerances.max()) > LOOSE_TOLERANCE for item in self.orientations
        )

    def pose_target(self, positions: Array, rng: np.random.Generator | None = None) -> Transform:
        """Returns a pose of `pose_link` in the planning frame that satisfies the constraints.

        Args:
            positions: State, for the poses of moving reference frames.
            rng: Random generator for a random pose; None for the centre of the first region and the target rotation.
        """
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        position, orientation = self.positions[0], self.orientations[0]
        index = 0 if rng is None else int(rng.integers(len(position.regions)))
        solid, pose = position.regions[index]
        origin = (position.reference.pose(self._data) * pose).act(np.zeros(3) if rng is None else solid.sample(rng))
        relative = orientation.target if rng is None else orientation.sample(rng)
        rotation = orientation.reference.pose(self._data).rotation @ relative
        return pin.SE3(rotation, origin - rotation @ position.offset)

    def bounds(self, indices: Index, positions: Array) -> tuple[Array, Array]:
        """Returns the lower and upper values of the given joints within joint bounds and joint constraints.

        A continuous joint gets the range nearest to `positions`. If the ranges do not overlap, lower exceeds upper.
        """
        lower, upper = self.model.lower.copy(), self.model.upper.copy()
        for item in self.joints:
            target = float(positions[item.index]) - item.deviation(positions)
            lower[item.index] = max(lower[item.index], target - item.below)
            upper[item.index] = min(upper[item.index], target + item.above)
        moving = np.asarray(indices, dtype=np.int64)
        return lower[moving], upper[moving]

    def project(self, positions: Array, indices: Index, steps: int = 60) -> Array | None:
        """Returns positions within bounds that satisfy all constraints, found by least-squares steps, or None.

        Args:
            positions: Initial positions.
            indices: Indices of the moving joints in a position vector; mimic joints follow.
            steps: Maximum number of steps.
        """
        moving = np.asarray(indices, dtype=np.int64)
        lower, upper = self.bounds(moving, positions)
        if (lower > upper).any():
            return None
        leaders = {int(index) for index in moving}
        current = np.array(positions, dtype=float)
        values = np.clip(current[moving], lower, upper)
        if not project(
            self.arrays[0], joint_mapping(self.model, self.arrays[1], moving, current), values, lower, upper, steps
        ):
            return None
        current[moving] = values
        return self.model.with_mimics(current, leaders)

    def sample(self, rng: np.random.Generator, positions: Array, indices: Index, attempts: int = 20) -> Array | None:
        """Returns the projection of a random state onto the constraints, or None.

        Args:
            rng: Random generator.
            positions: Positions of the fixed joints.
            indices: Indices of the moving joints.
            attempts: Maximum number of random states.
        """
        moving = np.asarray(indices, dtype=np.int64)
        lower, upper = self.bounds(moving, positions)
        if (lower > upper).any():
            return None
        centre = np.clip(positions[moving], lower, upper)
        low, high = np.maximum(lower, centre - 2.0 * np.pi), np.minimum(upper, centre + 2.0 * np.pi)
        for _ in range(attempts):
            state = np.array(positions, dtype=float)
            state[moving] = rng.uniform(low, high)
            state_found = self.project(state, moving)
            if state_found is not None:
                return state_found
        return None
