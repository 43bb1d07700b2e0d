# SPDX-License-Identifier: BSD-3-Clause
"""Says whether a state keeps joint, position and orientation constraints, and moves states until they do.

The meaning is that of MoveIt's kinematic constraints: a joint within its tolerances, a point of a link within one of
several regions, the rotation of a link within a tolerance about each axis.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from modular_framework_planning.regions import Solid
from modular_framework_planning.robot_model import RobotModel
from modular_framework_planning.spatial import Array, Transform

SLACK = 1.0e-6  # [m] or [rad]; the accuracy of inverse kinematics, so that a region of no extent can be met
INSIDE = 1.0e-5  # [m] or [rad]; projections aim this far inside a tolerance, not at its border
MAX_STEP = 0.3  # [rad or m]; of any joint in one step of a projection
DAMPING = 1.0e-6
LOOSE = 0.02  # [m] or [rad]; tolerances above this are worth looking around in
Index = Sequence[int] | NDArray[np.int64]
Row = tuple[Array, float]  # one linearised condition: (joint velocities -> change, change that is wanted)


class Parameterization(Enum):
    """How the three tolerances of an orientation are read; numbers as in moveit_msgs/OrientationConstraint."""

    XYZ_EULER_ANGLES = 0
    ROTATION_VECTOR = 1


@dataclass(frozen=True, slots=True)
class ConstraintResult:
    """What one constraint says of a state.

    Attributes:
        kind: "joint", "position" or "orientation".
        name: the joint or the link.
        distance: weighted deviation from the middle of what is allowed, as MoveIt reports it.
        text: by how much what is off, for people.
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

    def jacobian_at(self, model: Any, data: Any, point: Array) -> Array:
        """Returns how joint velocities move this frame, linear at `point` above angular, shape (6, nv)."""
        if not self.joint:
            return np.zeros((6, model.nv))
        jacobian = pin.getJointJacobian(model, data, self.joint, pin.LOCAL_WORLD_ALIGNED)
        x, y, z = point - data.oMi[self.joint].translation
        jacobian[:3] -= np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ jacobian[3:]
        return jacobian


@dataclass(frozen=True, slots=True)
class JointConstraint:
    """A joint that stays within [target - below, target + above] [rad or m]."""

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
        """Returns the verdict on a state."""
        value = self.deviation(positions)
        kept = -self.below - SLACK <= value <= self.above + SLACK
        text = (f"joint '{self.name}' is {value:+.4f} from {self.target:.4f}; allowed is -{self.below:.4f} to "
                f"+{self.above:.4f}")
        return ConstraintResult("joint", self.name, kept, self.weight * abs(value), text)

    def rows(self, *_: Any) -> Iterator[Row]:
        """Yields nothing: a projection keeps joints within their tolerance by clipping."""
        return iter(())


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

    def _gap(self, data: Any) -> tuple[float, Array, Array, Transform]:
        """Returns distance to the closest region, the point there, the point in the region's frame, its pose."""
        point = self.link.pose(data).act(self.offset)
        reference = self.reference.pose(data)
        best = None
        for solid, pose in self.regions:
            region = reference * pose
            inside = region.actInv(point)
            nearest = solid.nearest(inside)
            distance = float(np.linalg.norm(nearest - inside))
            if best is None or distance < best[0]:
                best = (distance, nearest, inside, region)
        assert best is not None, "a position constraint has at least one region"
        return best

    def evaluate(self, data: Any, _: Array) -> ConstraintResult:
        """Returns the verdict on the state whose joint placements `data` holds."""
        distance, _nearest, inside, _region = self._gap(data)
        text = f"link '{self.link.name}' is {distance:.4f} m outside its region"
        return ConstraintResult("position", self.link.name, distance <= SLACK,
                                self.weight * float(np.linalg.norm(inside)), text)

    def rows(self, model: Any, data: Any) -> Iterator[Row]:
        """Yields the condition that brings the point into the region; `data` holds the joint Jacobians."""
        distance, nearest, inside, region = self._gap(data)
        if distance <= SLACK:
            return
        depth = float(np.linalg.norm(nearest))
        aim = nearest * (1.0 - min(INSIDE / depth, 0.5)) if depth > 0.0 else nearest
        wanted = region.rotation @ (aim - inside)
        point, size = region.act(inside), float(np.linalg.norm(wanted))
        speed = self.link.jacobian_at(model, data, point)[:3] - self.reference.jacobian_at(model, data, point)[:3]
        yield wanted / size @ speed, size


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
        """Returns the verdict on the state whose joint placements `data` holds."""
        angles = np.abs(self.deviation(data)[0])
        excess = float((angles - self.tolerances).max())
        text = (f"link '{self.link.name}' is turned {np.array2string(angles, precision=4)} rad about x, y, z; allowed "
                f"is {np.array2string(self.tolerances, precision=4)}")
        return ConstraintResult("orientation", self.link.name, excess <= SLACK, self.weight * float(angles.sum()), text)

    def rows(self, model: Any, data: Any) -> Iterator[Row]:
        """Yields one condition per axis that is off; `data` holds the joint Jacobians."""
        angles, turned = self.deviation(data)
        if float((np.abs(angles) - self.tolerances).max()) <= SLACK:
            return
        limits = self.tolerances - np.minimum(INSIDE, 0.5 * self.tolerances)
        reference = self.reference.pose(data)
        where = self.link.pose(data).translation
        spin = (self.link.jacobian_at(model, data, where) - self.reference.jacobian_at(model, data, where))[3:]
        in_target = (reference.rotation @ self.target).T @ spin
        if self.parameterization is Parameterization.ROTATION_VECTOR:
            rates = self.target @ pin.Jlog3(turned) @ turned.T @ in_target
        else:
            rates = _euler_rates(angles) @ in_target
        for number in np.flatnonzero(np.abs(angles) > limits):
            yield rates[number], float(np.clip(angles[number], -limits[number], limits[number]) - angles[number])

    def sample(self, rng: np.random.Generator) -> Array:
        """Returns a random rotation within the tolerances, in the reference frame, shape (3, 3)."""
        angles = rng.uniform(-1.0, 1.0, 3) * np.minimum(self.tolerances, np.pi)
        if self.parameterization is Parameterization.ROTATION_VECTOR:
            return self.target @ pin.exp3(self.target.T @ angles)
        angles[1] = np.clip(angles[1], -0.5 * np.pi, 0.5 * np.pi)
        return self.target @ _rotation_x(angles[0]) @ pin.rpy.rpyToMatrix(0.0, angles[1], 0.0) @ pin.rpy.rpyToMatrix(
            0.0, 0.0, angles[2])


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


def _euler_rates(angles: Array) -> Array:
    """Returns the matrix from angular velocity (in the frame the angles start in) to rates of XYZ Euler angles."""
    sine, cosine = np.sin(angles[0]), np.cos(angles[0])
    pitch_cosine, pitch_sine = np.cos(angles[1]), np.sin(angles[1])
    pitch_cosine = float(np.copysign(max(abs(pitch_cosine), 1.0e-3), pitch_cosine))
    tangent = pitch_sine / pitch_cosine
    return np.array([[1.0, sine * tangent, -cosine * tangent], [0.0, cosine, sine],
                     [0.0, -sine / pitch_cosine, cosine / pitch_cosine]])


Constraint = JointConstraint | PositionConstraint | OrientationConstraint


class KinematicConstraints:
    """Constraints that must all hold at once.

    Not for use from two threads at a time: it holds the working memory of forward kinematics; `copy` gives another.
    Positions are those of the whole robot [rad or m].
    """

    def __init__(self, model: RobotModel, joints: Sequence[JointConstraint] = (),
                 positions: Sequence[PositionConstraint] = (),
                 orientations: Sequence[OrientationConstraint] = (), name: str = "") -> None:
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

    def region_centre(self, item: PositionConstraint, positions: Array) -> Array:
        """Returns the middle of a position constraint's first region in the planning frame [m]."""
        pin.forwardKinematics(self.model.pin_model, self._data, positions)
        return np.array((item.reference.pose(self._data) * item.regions[0][1]).translation)

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
        """Whether quite different states satisfy, so that looking around the middle of the tolerances pays."""
        return (any(solid.extent > LOOSE for item in self.positions for solid, _ in item.regions)
                or any(float(item.tolerances.max()) > LOOSE for item in self.orientations))

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
            indices: the joints that may move, as places in a position vector; mimic joints follow theirs.
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
            rows = [row for item in self._all for row in item.rows(self.model.pin_model, self._data)]
            if not rows:
                return current if self.satisfied(current) else None
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
            positions: where the joints that do not move are.
            indices: the joints that may move.
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
