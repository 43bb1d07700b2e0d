# SPDX-License-Identifier: BSD-3-Clause
"""Follows a path of link poses with joint positions that do not jump: inverse kinematics by continuation.

Each step starts from the joint positions before it and solves for the nearest solution by Newton's method, so the arm
never changes its posture on the way. Where it cannot go on, the error says which joint would have to jump or leave its
bounds, or that the pose is out of reach.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

POSE_TOLERANCE = 1.0e-9  # [m] and [rad] together
ACCEPTED_ERROR = 1.0e-7  # where rounding keeps Newton's method from the tolerance above
NEWTON_STEPS = 25
MAX_JUMP = 0.3  # [rad or m] between a step's guess and its solution
MAX_TRAVEL = 1.5  # [rad or m] Newton's method may go before it is given up
BOUND_TOLERANCE = 1.0e-6


@dataclass(frozen=True, slots=True, eq=False)
class LinkMotion:
    """Velocity and acceleration of a link in the planning frame: shape (6,), linear before angular.

    Attributes:
        velocity: [m/s, rad/s].
        acceleration: [m/s^2, rad/s^2].
    """

    velocity: Array
    acceleration: Array


class PoseFollower:
    """Follows poses of one link with the joints of one group; not thread-safe."""

    def __init__(self, solver: InverseKinematics, link: str, rest: Array) -> None:
        """Prepares the working memory.

        Args:
            solver: inverse kinematics of the group.
            link: at the end of the group's chain, see InverseKinematics.tip_offset.
            rest: positions of the whole robot; those outside the group stay.

        Raises:
            PlanningError: the link does not exist or is not rigid to the chain's end.
        """
        solver.tip_offset(link, rest)
        self.model: RobotModel = solver.model
        self.group: JointGroup = solver.group
        self.link = link
        self._solver = solver
        self._rest = np.array(rest, dtype=float)
        self._members = frozenset(int(number) for number in self.group.indices)
        self._followers = [
            (follower, self.group.joints.index(self.model.joint_names[leader]), multiplier)
            for follower, leader, multiplier, _ in self.model.mimics
            if leader in self._members
        ]
        self._frame = self.model.frame_ids[link]
        self._data = self.model.pin_model.createData()

    def full_positions(self, values: Array) -> Array:
        """Returns positions of the whole robot for joint values of the group."""
        positions = self._rest.copy()
        positions[self.group.indices] = values
        return self.model.with_mimics(positions, self._members) if self._followers else positions

    def pose(self, values: Array) -> Transform:
        """Returns the link's pose in the planning frame."""
        pin.framesForwardKinematics(self.model.pin_model, self._data, self.full_positions(values))
        return self._data.oMf[self._frame].copy()

    def _jacobian(self, positions: Array, frame: Any) -> Array:
        """Returns the link's Jacobian of the group's joints and leaves the link's placement in the data."""
        pin.computeJointJacobians(self.model.pin_model, self._data, positions)
        pin.updateFramePlacement(self.model.pin_model, self._data, self._frame)
        jacobian = pin.getFrameJacobian(self.model.pin_model, self._data, self._frame, frame)
        chosen = np.array(jacobian[:, self.group.indices])
        for follower, leader, multiplier in self._followers:
            chosen[:, leader] += multiplier * jacobian[:, follower]
        return chosen

    @property
    def is_redundant(self) -> bool:
        """Whether the group has more joints than a pose determines."""
        return len(self.group.joints) > 6

    def step(self, guess: Array, target: Transform, wanted: Array | None = None) -> Array:
        """Returns joint values that bring the link to a pose.

        Args:
            guess: where the joints are expected; a solution further than 0.3 rad (or m) from it is a jump.
            target: pose in the planning frame.
            wanted: posture a redundant arm keeps nearest to; the guess by default.

        Raises:
            PlanningError: NO_IK_SOLUTION with the joint that would jump or leave its bounds, or why there is none.
        """
        values = self._newton(wanted if wanted is not None and self.is_redundant else guess, target)
        if values is None:
            values = self._nearest_solution(guess, target)
        jump = np.abs(values - guess)
        if jump.max() > MAX_JUMP:
            number = int(jump.argmax())
            raise self._refusal(
                f"joint '{self.group.joints[number]}' would jump from {guess[number]:.3f} to "
                f"{values[number]:.3f}, because the arm is near a singular posture"
            )
        problems = self.model.bound_violations(self.full_positions(values), self.group.indices, BOUND_TOLERANCE)
        if problems:
            raise self._refusal("; ".join(problems))
        return np.clip(values, self.model.lower[self.group.indices], self.model.upper[self.group.indices])

    def _refusal(self, reason: str) -> PlanningError:
        return PlanningError(ErrorCode.NO_IK_SOLUTION, f"'{self.link}' cannot go on along the path: {reason}")

    def _newton(self, guess: Array, target: Transform) -> Array | None:
        """Solves from the guess by damped least squares; None where it does not converge."""
        values, size = guess, np.inf
        for _ in range(NEWTON_STEPS):
            jacobian = self._jacobian(self.full_positions(values), pin.ReferenceFrame.LOCAL)
            error = pin.log6(self._data.oMf[self._frame].actInv(target)).vector
            size = float(np.linalg.norm(error))
            if size < POSE_TOLERANCE:
                return values
            damping = min(1.0e-4, size * size) * np.eye(6)
            values = values + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping, error)
            if float(np.abs(values - guess).max()) > MAX_TRAVEL:
                return None
        return values if size < ACCEPTED_ERROR else None

    def _nearest_solution(self, guess: Array, target: Transform) -> Array:
        indices = self.group.indices
        seed = self.full_positions(np.clip(guess, self.model.lower[indices], self.model.upper[indices]))
        found = self._solver.solutions(self.link, target, seed)
        if not found:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, self._solver.explain_unreachable(self.link, target, seed))
        return np.asarray(found[0][self.group.indices], dtype=float)

    def rates(
        self, values: Array, motion: LinkMotion, wanted: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Returns joint velocities and accelerations that give the link a velocity and an acceleration.

        Args:
            values: joint values of the moment.
            motion: of the link.
            wanted: velocities and accelerations a redundant arm keeps nearest to; rest by default.
        """
        model, data, positions = self.model.pin_model, self._data, self.full_positions(values)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self._jacobian(positions, world)
        inverse = np.linalg.pinv(jacobian)
        rest = np.zeros(len(values))
        speeds, changes = wanted if wanted is not None and self.is_redundant else (rest, rest)
        velocities = speeds + inverse @ (motion.velocity - jacobian @ speeds)
        rates = np.zeros(model.nv)
        rates[self.group.indices] = velocities
        for follower, leader, multiplier in self._followers:
            rates[follower] = multiplier * velocities[leader]
        pin.forwardKinematics(model, data, positions, rates, np.zeros(model.nv))
        drift: Any = pin.getFrameClassicalAcceleration(model, data, self._frame, world)
        return velocities, changes + inverse @ (motion.acceleration - drift.vector - jacobian @ changes)
