# SPDX-License-Identifier: BSD-3-Clause
"""Leads joint vectors of a group along constraints: from one state that satisfies them towards another."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.constraints.compiled_constraints import walk
from modular_framework_planning.constraints.condition_arrays import drive_of
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

LONGEST = 0.5  # [rad or m]; of a straight piece before its end is projected
STATES = 256  # of a whole way, at most


class ConstrainedMotion:
    """Motions of some joints; the others stay, and mimic joints follow."""

    def __init__(
        self, constraints: KinematicConstraints, indices: NDArray[np.int64], rest: Array, step: float, shortest: float
    ) -> None:
        """Stores what the motions keep to.

        Args:
            constraints: that hold along them.
            indices: of the joints that move, in a position vector.
            rest: positions of the whole robot, for all other joints [rad or m].
            step: distance of the samples of a straight piece at which constraints are looked at, in any joint
                [rad or m].
            shortest: length of the straight pieces below which the constraints count as impassable [rad or m].
        """
        self._conditions, columns = constraints.arrays
        self._drive = drive_of(constraints.model, columns, indices, rest)
        self._bounds = constraints.bounds(indices, rest)
        self._sizes = LONGEST, shortest, step

    def steps_towards(self, start: Array, target: Array, most: int) -> Array:
        """Returns states behind the start, shape (n, joints), n at most `most`; fewer where the walk ends.

        It ends at the target, exactly, or where no step leads nearer to that.
        """
        out = np.empty((most, len(start)))
        return out[: walk(self._conditions, self._drive, start, target, *self._bounds, *self._sizes, out)]

    def way(self, start: Array, target: Array) -> Array | None:
        """Returns states from the start to the target, both included; None where the walk does not arrive."""
        states = self.steps_towards(start, target, STATES)
        arrives = len(states) > 0 and np.array_equal(states[-1], target)
        return np.vstack([start[None], states]) if arrives else None


def warm_up(model: RobotModel) -> None:
    """Compiles the loops of constraints, or loads them from the cache.

    Args:
        model: any robot with a joint.
    """
    positions, frame = model.default_positions(), FrameOnRobot("", 1, pin.SE3.Identity())
    planning_frame = FrameOnRobot("", 0, pin.SE3.Identity())
    at = planning_frame.placement
    constraints = KinematicConstraints(
        model,
        [JointConstraint("", 0, 0.0, 1.0, 1.0)],
        [PositionConstraint(frame, np.zeros(3), planning_frame, ((SphereSolid(10.0), at),))],
        [OrientationConstraint(frame, planning_frame, np.eye(3), np.full(3, np.pi))],
    )
    indices = np.array([0])
    constraints.satisfied(positions)
    constraints.edges_hold(np.array([positions, positions]), 1.0)
    constraints.project(positions, indices)
    ConstrainedMotion(constraints, indices, positions, 1.0, 1.0).way(np.zeros(1), np.ones(1))
