# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics by continuation: follows a path of link poses without joint jumps.

Each step starts from the previous joint positions and finds the nearest solution by Newton's method, so that the arm
keeps its posture. If the path cannot be followed, the error names the joint that would jump or leave its bounds, or
states that the pose is out of reach.
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

POSE_TOLERANCE = 1.0e-9  # tolerance of the pose error norm [m and rad]
ACCEPTED_ERROR = 1.0e-7  # accepted error if rounding prevents convergence to POSE_TOLERANCE
NEWTON_STEPS = 25
MIN_DAMPING = 1.0e-12  # keeps the matrix of an arm with fewer than six joints regular
MAX_JUMP = 0.3  # maximum difference between a guess and its solution [rad or m]
MAX_TRAVEL = 1.5  # larger joint displacements count as divergence of Newton's method [rad or m]
BOUND_TOLERANCE = 1.0e-6


@dataclass(frozen=True, slots=True, eq=False)
class LinkMotion:
    """Velocity and acceleration of a link in the planning frame, linear before angular.

    Attributes:
        velocity: Spatial velocity, shape (6,) [m/s, rad/s].
        acceleration: Spatial acceleration, shape (6,) [m/s^2, rad/s^2].
    """

    velocity: Array
    acceleration: Array


class PoseFollower:
    """Follows poses of a link, or of a frame that the link carries, with the joints of a group; not thread-safe."""

    def __init__(self, solver: InverseKinematics, link: str, rest: Array, carried: Transform | None = None) -> None:
        """Prepares the working memory.

        Args:
            solver: Kinematics solver of the group.
            link: Link at the end of the group's chain, see InverseKinematics.tip_offset.
            rest: Positions of the whole robot, for joints outside the group [rad or m].
            carried: Pose of the moved frame in the link, such as a subframe of a held object; None for the link frame.

        Raises:
            PlanningError: The link does not exist or is not rigidly fixed to the end of the chain.
        """
        solver.tip_offset(link, rest)
        self.model: RobotModel = solver.model
        self.group: JointGroup = solver.group
        self.link = link
        self._carried = pin.SE3.Identity() if carried is None else carried
        self._solver = solver
        self.rest = np.array(rest, dtype=float)
        self._members = frozenset(int(index) for index in self.group.indices)
        self._followers = [
            (follower, self.group.joints.index(self.model.joint_names[leader]), multiplier)
            for follower, leader, multiplier, _ in self.model.mimics
            if leader in self._members
        ]
        self._frame = self.model.frame_ids[link]
        self._data = self.model.pin_model.createData()

    def full_positions(self, values: Array) -> Array:
        """Returns the positions of the whole robot for joint values of the group."""
        positions = self.rest.copy()
        positions[self.group.indices] = values
        return self.model.with_mimics(positions, self._members) if self._followers else positions

    def pose(self, values: Array) -> Transform:
        """Returns the pose of the moved frame in the planning frame."""
        pin.framesForwardKinematics(self.model.pin_model, self._data, self.full_positions(values))
        return self._data.oMf[self._frame] * self._carried

    def _jacobian(self, positions: Array, frame: Any) -> Array:
        """Returns the link's Jacobian over the group's joints, and updates the link's placement in the data."""
        pin.computeJointJacobians(self.model.pin_model, self._data, positions)
        pin.updateFramePlacement(self.model.pin_model, self._data, self._frame)
        jacobian = pin.getFrameJacobian(self.model.pin_model, self._data, self._frame, frame)
        columns = np.array(jacobian[:, self.group.indices])
        for follower, leader, multiplier in self._followers:
            columns[:, leader] += multiplier * jacobian[:, follower]
        return columns

    @property
    def is_redundant(self) -> bool:
        """Whether the group has more than six joints."""
        return len(self.group.joints) > 6

    def solve(self, guess: Array, target: Transform, preferred: Array | None = None) -> Array:
        """Returns joint values that bring the moved frame to a pose.

        Args:
            guess: Expected joint values; a solution farther away than MAX_JUMP is a jump.
            target: Target pose of the moved frame in the planning frame.
            preferred: Preferred posture of a redundant arm; None for the guess.

        Raises:
            PlanningError: NO_IK_SOLUTION, with the joint that would jump or leave its bounds, or with the reason.
        """
        target = target * self._carried.inverse()
        values = self._newton(preferred if preferred is not None and self.is_redundant else guess, target)
        if values is None:
            values = self._nearest_solution(guess, target)
        jump = np.abs(values - guess)
        if jump.max() > MAX_JUMP:
            index = int(jump.argmax())
            raise self._refusal(
                f"joint '{self.group.joints[index]}' would jump from {guess[index]:.3f} to "
                f"{values[index]:.3f}, because the arm is near a singular posture"
            )
        problems = self.model.bound_violations(self.full_positions(values), self.group.indices, BOUND_TOLERANCE)
        if problems:
            raise self._refusal("; ".join(problems))
        return np.clip(values, self.model.lower[self.group.indices], self.model.upper[self.group.indices])

    def _refusal(self, reason: str) -> PlanningError:
        return PlanningError(ErrorCode.NO_IK_SOLUTION, f"'{self.link}' cannot follow the path: {reason}")

    def _newton(self, guess: Array, target: Transform) -> Array | None:
        """Returns the solution of damped least squares from a guess, or None if it does not converge."""
        values, size = guess, np.inf
        for _ in range(NEWTON_STEPS):
            jacobian = self._jacobian(self.full_positions(values), pin.ReferenceFrame.LOCAL)
            error = pin.log6(self._data.oMf[self._frame].actInv(target)).vector
            size = float(np.linalg.norm(error))
            if size < POSE_TOLERANCE:
                return values
            damping = min(max(size * size, MIN_DAMPING), 1.0e-4) * np.eye(6)
            values = values + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping, error)
            if float(np.abs(values - guess).max()) > MAX_TRAVEL:
                return None
        return values if size < ACCEPTED_ERROR else None

    def _nearest_solution(self, guess: Array, target: Transform) -> Array:
        indices = self.group.indices
        seed = self.full_positions(np.clip(guess, self.model.lower[indices], self.model.upper[indices]))
        solutions = self._solver.solutions(self.link, target, seed)
        if not solutions:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, self._solver.explain_unreachable(self.link, target, seed))
        return np.asarray(solutions[0][self.group.indices], dtype=float)

    def _link_motion(self, motion: LinkMotion) -> LinkMotion:
        """Returns the motion of the link's origin, from the motion of the moved frame and the placement in the data."""
        lever = self._data.oMf[self._frame].rotation @ self._carried.translation
        angular, angular_rate = motion.velocity[3:], motion.acceleration[3:]
        velocity, acceleration = motion.velocity.copy(), motion.acceleration.copy()
        velocity[:3] -= np.cross(angular, lever)
        acceleration[:3] -= np.cross(angular_rate, lever) + np.cross(angular, np.cross(angular, lever))
        return LinkMotion(velocity, acceleration)

    def joint_rates(
        self, values: Array, motion: LinkMotion, preferred: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Returns the joint velocities and accelerations of a motion.

        Args:
            values: Joint values.
            motion: Velocity and acceleration of the moved frame.
            preferred: Preferred joint velocities and accelerations of a redundant arm; None for zero.
        """
        model, data, positions = self.model.pin_model, self._data, self.full_positions(values)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self._jacobian(positions, world)
        motion = self._link_motion(motion)
        inverse = np.linalg.pinv(jacobian)
        rest = np.zeros(len(values))
        preferred_velocities, preferred_accelerations = (
            preferred if preferred is not None and self.is_redundant else (rest, rest)
        )
        velocities = preferred_velocities + inverse @ (motion.velocity - jacobian @ preferred_velocities)
        all_velocities = np.zeros(model.nv)
        all_velocities[self.group.indices] = velocities
        for follower, leader, multiplier in self._followers:
            all_velocities[follower] = multiplier * velocities[leader]
        pin.forwardKinematics(model, data, positions, all_velocities, np.zeros(model.nv))
        drift: Any = pin.getFrameClassicalAcceleration(model, data, self._frame, world)
        return velocities, preferred_accelerations + inverse @ (
            motion.acceleration - drift.vector - jacobian @ preferred_accelerations
        )
