# SPDX-License-Identifier: BSD-3-Clause
"""Joint, position and orientation constraints, with the meaning of MoveIt's kinematic constraints.

A joint stays within its tolerances, a point of a link within one of several regions, and the rotation of a link within
a tolerance about each axis.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from enum import Enum

import numpy as np
import pinocchio as pin

from modular_framework_planning.constraints.compiled_constraints import TOLERANCE
from modular_framework_planning.geometry.regions import Solid
from modular_framework_planning.geometry.spatial import Array, Transform


class Parameterization(Enum):
    """Parameterization of orientation tolerances, with the values of moveit_msgs/OrientationConstraint."""

    XYZ_EULER_ANGLES = 0
    ROTATION_VECTOR = 1


@dataclass(frozen=True, slots=True)
class ConstraintResult:
    """Evaluation of a constraint for a state.

    Attributes:
        kind: "joint", "position" or "orientation".
        name: Name of the joint or link.
        satisfied: Whether the state satisfies the constraint.
        distance: Weighted deviation from the centre of the allowed range, as in MoveIt.
        text: Description of the deviation.
    """

    kind: str
    name: str
    satisfied: bool
    distance: float
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class FrameOnRobot:
    """A frame that moves with a joint of the robot; joint 0 is the fixed planning frame."""

    name: str
    joint: int
    placement: Transform

    def pose(self, data: pin.Data) -> Transform:
        """Returns the pose in the planning frame for the joint placements in `data`."""
        return data.oMi[self.joint] * self.placement if self.joint else self.placement


@dataclass(frozen=True, slots=True)
class JointConstraint:
    """Keeps a joint within [target - below, target + above].

    Attributes:
        name: Joint name.
        index: Index of the joint in a position vector of the whole robot.
        target: Target position [rad or m].
        below, above: Lower and upper tolerance [rad or m].
        is_continuous: Whether the joint is continuous.
        weight: Weight of the constraint [1].
    """

    name: str
    index: int
    target: float
    below: float
    above: float
    _: KW_ONLY
    is_continuous: bool = False
    weight: float = 1.0

    def deviation(self, positions: Array) -> float:
        """Returns the deviation from the target, by the shorter rotation for a continuous joint."""
        value = float(positions[self.index]) - self.target
        return float(np.arctan2(np.sin(value), np.cos(value))) if self.is_continuous else value

    def evaluate(self, positions: Array) -> ConstraintResult:
        """Returns the evaluation of a state."""
        value = self.deviation(positions)
        is_satisfied = -self.below - TOLERANCE <= value <= self.above + TOLERANCE
        text = (
            f"joint '{self.name}' is {value:+.4f} from {self.target:.4f}; allowed: -{self.below:.4f} to "
            f"+{self.above:.4f}"
        )
        return ConstraintResult("joint", self.name, is_satisfied, self.weight * abs(value), text)


@dataclass(frozen=True, slots=True, eq=False)
class PositionConstraint:
    """Keeps a point of a link in one of several regions.

    Attributes:
        link: Link frame.
        offset: Point in the link frame, shape (3,) [m].
        reference: Reference frame of the regions, which may move.
        regions: Solids and their poses in the reference frame.
        weight: Weight of the constraint [1].
    """

    link: FrameOnRobot
    offset: Array
    reference: FrameOnRobot
    regions: tuple[tuple[Solid, Transform], ...]
    weight: float = 1.0

    def result(self, distance: float, point: Array) -> ConstraintResult:
        """Returns the result for a distance from the nearest region [m], and the point in the frame of this region."""
        text = f"link '{self.link.name}' is {distance:.4f} m outside its region"
        return ConstraintResult(
            "position", self.link.name, distance <= TOLERANCE, self.weight * float(np.linalg.norm(point)), text
        )


@dataclass(frozen=True, slots=True, eq=False)
class OrientationConstraint:
    """Keeps the orientation of a link near a target.

    Attributes:
        link: Link frame.
        reference: Reference frame, which may move.
        target: Target rotation in the reference frame, shape (3, 3).
        tolerances: Tolerances about x, y and z, shape (3,) [rad].
        parameterization: Whether the tolerances limit the intrinsic XYZ Euler angles of the deviation, or its rotation
            vector along the axes of the reference frame.
        weight: Weight of the constraint [1].
    """

    link: FrameOnRobot
    reference: FrameOnRobot
    target: Array
    tolerances: Array
    parameterization: Parameterization = Parameterization.XYZ_EULER_ANGLES
    weight: float = 1.0

    def result(self, excess: float, angles: Array) -> ConstraintResult:
        """Returns the result for a violation of the tolerances, and the deviation about the three axes [rad]."""
        angles = np.abs(angles)
        text = (
            f"link '{self.link.name}' is rotated by {np.array2string(angles, precision=4)} rad about x, y, z; allowed: "
            f"{np.array2string(self.tolerances, precision=4)}"
        )
        return ConstraintResult(
            "orientation", self.link.name, excess <= TOLERANCE, self.weight * float(angles.sum()), text
        )

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random rotation within the tolerances, in the reference frame, shape (3, 3)."""
        angles = rng.uniform(-1.0, 1.0, 3) * np.minimum(self.tolerances, np.pi)
        if self.parameterization is Parameterization.ROTATION_VECTOR:
            return self.target @ pin.exp3(self.target.T @ angles)
        angles[1] = np.clip(angles[1], -0.5 * np.pi, 0.5 * np.pi)
        return (
            self.target
            @ _rotation_x(angles[0])
            @ pin.rpy.rpyToMatrix(0.0, angles[1], 0.0)
            @ pin.rpy.rpyToMatrix(0.0, 0.0, angles[2])
        )


def _rotation_x(angle: float) -> Array:
    return pin.rpy.rpyToMatrix(angle, 0.0, 0.0)
