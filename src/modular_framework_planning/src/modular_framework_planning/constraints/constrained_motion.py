# SPDX-License-Identifier: BSD-3-Clause
"""Motions along constraints, from a state that satisfies the constraints towards a target state."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import walk
from modular_framework_planning.constraints.constraint_arrays import joint_mapping
from modular_framework_planning.constraints.constraint_kinds import (
    FrameOnRobot,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.geometry.regions import SphereSolid
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel

MAX_STEP = 0.5  # maximum length of a step before its end is projected [rad or m]
MAX_STATES = 256


class ConstrainedMotion:
    """Motions of a group's joints along constraints while all other joints stay fixed."""

    def __init__(
        self, constraints: KinematicConstraints, indices: NDArray[np.int64], rest: Array, step: float, min_step: float
    ) -> None:
        """Stores the constraints.

        Args:
            constraints: Constraints along the motions.
            indices: Indices of the moving joints in a position vector.
            rest: Positions of the whole robot, for all other joints [rad or m].
            step: Maximum joint displacement between constraint checks [rad or m].
            min_step: Minimum length of a step; a shorter step ends the motion [rad or m].
        """
        self._constraints, columns = constraints.arrays
        self._mapping = joint_mapping(constraints.model, columns, indices, rest)
        self._bounds = constraints.bounds(indices, rest)
        self._step_limits = MAX_STEP, min_step, step

    def steps_towards(self, start: Array, target: Array, max_states: int) -> Array:
        """Returns up to `max_states` states after the start, shape (n, joints).

        The motion ends exactly at the target, or if no step leads closer to the target.

        Args:
            start: Joint vector that satisfies the constraints, shape (joints,).
            target: Joint vector, shape (joints,).
            max_states: Maximum number of states.
        """
        out = np.empty((max_states, len(start)))
        return out[: walk(self._constraints, self._mapping, start, target, *self._bounds, *self._step_limits, out)]

    def connect(self, start: Array, target: Array) -> Array | None:
        """Returns states from the start to the target, including both, or None if the target is not reached."""
        states = self.steps_towards(start, target, MAX_STATES)
        arrives = len(states) > 0 and np.array_equal(states[-1], target)
        return np.vstack([start[None], states]) if arrives else None


def warm_up(model: RobotModel) -> None:
    """Compiles the loops of constraints or loads them from the cache.

    Args:
        model: Any robot model with a joint.
    """
    positions, frame = model.default_positions(), FrameOnRobot("", 1, pin.SE3.Identity())
    planning_frame = FrameOnRobot("", 0, pin.SE3.Identity())
    identity = planning_frame.placement
    constraints = KinematicConstraints(
        model,
        [JointConstraint("", 0, 0.0, 1.0, 1.0)],
        [PositionConstraint(frame, np.zeros(3), planning_frame, ((SphereSolid(10.0), identity),))],
        [OrientationConstraint(frame, planning_frame, np.eye(3), np.full(3, np.pi))],
    )
    indices = np.array([0])
    constraints.are_satisfied(positions)
    constraints.evaluate(positions)
    constraints.edges_satisfied(np.array([positions, positions]), 1.0)
    constraints.project(positions, indices)
    ConstrainedMotion(constraints, indices, positions, 1.0, 1.0).connect(np.zeros(1), np.ones(1))
