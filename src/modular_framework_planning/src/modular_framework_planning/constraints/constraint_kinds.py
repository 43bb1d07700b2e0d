# SPDX-License-Identifier: BSD-3-Clause
"""Kinematic constraints on a state: joint, position and orientation constraints.

The meaning is that of MoveIt's kinematic constraints: a joint within its tolerances, a point of a link within one of
several regions, the rotation of a link within a tolerance about each axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_planning.constraints.compiled_constraints import SLACK
from modular_framework_planning.geometry.regions import Solid
from modular_framework_planning.geometry.spatial import Array, Transform


class Parameterization(Enum):
    """Parameterization of the tolerances of an orientation; numbers as in moveit_msgs/OrientationConstraint."""

    XYZ_EULER_ANGLES = 0
    ROTATION_VECTOR = 1


@dataclass(frozen=True, slots=True)
class ConstraintResult:
    """The result of one constraint for a state.

    Attributes:
        kind: "joint", "position" or "orientation".
        name: the joint or the link.
        distance: weighted deviation from the middle of what is allowed, as MoveIt reports it.
        text: what deviates by how much, for people.
    """

    kind: str
    name: str
    satisfied: bool
    distance: float
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class FrameOnRobot:
    """A frame that moves with a joint of the robot; joint 0 is the planning frame, which does not move."""

    name: str
    joint: int
    placement: Transform

    def pose(self, data: Any) -> Transform:
        """Returns the pose in the planning frame; `data` holds the joint placements of the state."""
        return data.oMi[self.joint] * self.placement if self.joint else self.placement


@dataclass(frozen=True, slots=True)
class JointConstraint:
    """A joint that stays within [target - below, target + above].

    Attributes:
        name: of the joint.
        index: of the joint in a position vector of the whole robot.
        target: position [rad or m].
        below, above: tolerance on each side [rad or m].
        is_continuous: whether a whole turn makes no difference.
        weight: of the constraint among others [1].
    """

    name: str
    index: int
    target: float
    below: float
    above: float
    is_continuous: bool = False
    weight: float = 1.0

    def deviation(self, positions: Array) -> float:
        """Returns how far the joint is from its target; the short way round for a joint without ends."""
        value = float(positions[self.index]) - self.target
        return float(np.arctan2(np.sin(value), np.cos(value))) if self.is_continuous else value

    def evaluate(self, _: Any, positions: Array) -> ConstraintResult:
        """Evaluates a state."""
        value = self.deviation(positions)
        kept = -self.below - SLACK <= value <= self.above + SLACK
        text = (
            f"joint '{self.name}' is {value:+.4f} from {self.target:.4f}; allowed is -{self.below:.4f} to "
            f"+{self.above:.4f}"
        )
        return ConstraintResult("joint", self.name, kept, self.weight * abs(value), text)


@dataclass(frozen=True, slots=True, eq=False)
class PositionConstraint:
    """A point of a link that stays in one of several regions.

    Attributes:
        link: frame of the link; offset: the point in it [m].
        reference: frame the regions' poses are given in; it may move.
        regions: solids and their poses.
    """

    link: FrameOnRobot
    offset: Array
    reference: FrameOnRobot
    regions: tuple[tuple[Solid, Transform], ...]
    weight: float = 1.0

    def _gap(self, data: Any) -> tuple[float, Array]:
        """Returns the distance to the closest region, and the point in the frame of that one."""
        point = self.link.pose(data).act(self.offset)
        reference = self.reference.pose(data)
        inside = [(reference * pose).actInv(point) for _, pose in self.regions]
        gaps = [
            float(np.linalg.norm(solid.nearest(at) - at)) for (solid, _), at in zip(self.regions, inside, strict=True)
        ]
        closest = int(np.argmin(gaps))
        return gaps[closest], inside[closest]

    def evaluate(self, data: Any, _: Array) -> ConstraintResult:
        """Evaluates the state whose joint placements `data` holds."""
        distance, inside = self._gap(data)
        text = f"link '{self.link.name}' is {distance:.4f} m outside its region"
        return ConstraintResult(
            "position", self.link.name, distance <= SLACK, self.weight * float(np.linalg.norm(inside)), text
        )


@dataclass(frozen=True, slots=True, eq=False)
class OrientationConstraint:
    """A link whose rotation stays near a given one.

    Attributes:
        target: the rotation in the reference frame, shape (3, 3).
        tolerances: about x, y and z [rad]. Of intrinsic XYZ Euler angles of the deviation, or of its rotation vector
            along the axes of the reference frame.
    """

    link: FrameOnRobot
    reference: FrameOnRobot
    target: Array
    tolerances: Array
    parameterization: Parameterization = Parameterization.XYZ_EULER_ANGLES
    weight: float = 1.0

    def deviation(self, data: Any) -> tuple[Array, Array]:
        """Returns the three deviations [rad] and the deviating rotation."""
        current = self.reference.pose(data).rotation.T @ self.link.pose(data).rotation
        turned = self.target.T @ current
        if self.parameterization is Parameterization.ROTATION_VECTOR:
            return self.target @ pin.log3(turned), turned
        angles, regular = euler_xyz(turned)
        if not regular and abs(angles[0]) > self.tolerances[0]:
            angles = np.array([0.0, angles[1], angles[0]])  # roll and yaw turn about one axis: either may take it
        return angles, turned

    def evaluate(self, data: Any, _: Array) -> ConstraintResult:
        """Evaluates the state whose joint placements `data` holds."""
        angles = np.abs(self.deviation(data)[0])
        excess = float((angles - self.tolerances).max())
        text = (
            f"link '{self.link.name}' is turned {np.array2string(angles, precision=4)} rad about x, y, z; allowed "
            f"is {np.array2string(self.tolerances, precision=4)}"
        )
        return ConstraintResult("orientation", self.link.name, excess <= SLACK, self.weight * float(angles.sum()), text)

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


def euler_xyz(rotation: Array) -> tuple[Array, bool]:
    """Returns intrinsic XYZ Euler angles [rad] of a rotation, and False where only roll plus or minus yaw is known."""
    sine = min(max(float(rotation[0, 2]), -1.0), 1.0)
    pitch = float(np.arcsin(sine))
    if abs(sine) > 1.0 - 1.0e-12:
        return np.array([np.arctan2(rotation[2, 1], rotation[1, 1]), pitch, 0.0]), False
    roll = np.arctan2(-rotation[1, 2], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(-rotation[0, 1], rotation[0, 0])]), True


Constraint = JointConstraint | PositionConstraint | OrientationConstraint
