# SPDX-License-Identifier: BSD-3-Clause
"""Finds joint positions that bring a link to a pose: every closed-form solution where there are some, else numeric."""
from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.robot_model import JointGroup, RobotModel
from modular_framework_planning.spatial import Array, Transform

POSE_TOLERANCE = 1.0e-6  # [m] and [rad]; every returned solution is checked by forward kinematics against this
SAME_SOLUTION = 1.0e-5  # [rad]
MAX_WRAPS = 4096
NEWTON_STEPS = 8


class AnalyticSolver:
    """Closed-form inverse kinematics of a six-joint chain by subproblem decomposition (EAIK)."""

    def __init__(self, model: RobotModel, group: JointGroup, base_link: str, tip_link: str) -> None:
        """Reads axes and offsets of the chain from the model with all joints at zero.

        Raises:
            PlanningError: the chain has no known decomposition.
        """
        from eaik.IK_HP import HPRobot

        data = model.pin_model.createData()
        pin.framesForwardKinematics(model.pin_model, data, model.with_mimics(np.zeros(len(model.joint_names))))
        base = data.oMf[model.frame_ids[base_link]].inverse()
        tip = base * data.oMf[model.frame_ids[tip_link]]
        axes, points = [], []
        for name in group.joints:
            number = model.pin_model.getJointId(name)
            placement = base * data.oMi[number]
            direction = {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1)}
            joint = model.pin_model.joints[number]
            axis = _joint_axis(joint, direction)
            axes.append(placement.rotation @ axis)
            points.append(placement.translation)
        points.append(tip.translation)
        offsets = np.diff(np.vstack([np.zeros(3), points]), axis=0)
        self._robot = HPRobot(np.array(axes), offsets)
        if not self._robot.hasKnownDecomposition():
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"group '{group.name}': no closed-form solution is known")
        self._tip_rotation_at_zero = tip.rotation.copy()

    def solve(self, tip_in_base: Transform) -> list[Array]:
        """Returns candidate joint vectors; least-squares approximations are left out by the caller's check."""
        target = tip_in_base.homogeneous.copy()
        target[:3, :3] = tip_in_base.rotation @ self._tip_rotation_at_zero.T
        return [np.asarray(q, dtype=float) for q in self._robot.IK(target).Q]


def _joint_axis(joint: Any, direction: dict[str, tuple[int, int, int]]) -> Array:
    """Returns the rotation axis of a revolute Pinocchio joint in its own frame."""
    short = joint.shortname()
    if short.startswith("JointModelR") and short[-1] in direction:
        return np.array(direction[short[-1]], dtype=float)
    if short == "JointModelRevoluteUnaligned":
        return np.array(joint.extract().axis if hasattr(joint, "extract") else joint.axis, dtype=float)
    raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"joint model {short} is not a plain revolute joint")


class InverseKinematics:
    """Solves for one group of the robot; safe to share between threads."""

    def __init__(self, model: RobotModel, group: JointGroup) -> None:
        if not group.is_chain:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"group '{group.name}' is not a chain of joints; inverse "
                                "kinematics needs a chain from a base link to a tip link")
        self.model = model
        self.group = group
        self._members = frozenset(int(number) for number in group.indices)
        self._last_link = model.document.joint_children[group.joints[-1]]
        self.base_link = model.document.joint_parents[group.joints[0]]
        self._analytic = self._try_analytic()
        self.reach = self._max_reach()

    @property
    def is_analytic(self) -> bool:
        """Whether the closed form is used."""
        return self._analytic is not None

    def _try_analytic(self) -> AnalyticSolver | None:
        kinds = {self.model.document.joint_kinds[name] for name in self.group.joints}
        if len(self.group.joints) != 6 or not kinds <= {"revolute", "continuous"}:
            return None
        try:
            return AnalyticSolver(self.model, self.group, self.base_link, self._last_link)
        except PlanningError:
            return None

    def _max_reach(self) -> float:
        """Returns an upper bound of the distance from the second joint to the last joint's link [m]."""
        pin_model = self.model.pin_model
        numbers = [pin_model.getJointId(name) for name in self.group.joints]
        return float(sum(np.linalg.norm(pin_model.jointPlacements[number].translation) for number in numbers[1:]))

    def tip_offset(self, tip_link: str) -> Transform:
        """Returns the pose of the last joint's link in the frame of a tip rigidly fixed to it.

        Raises:
            UnknownNameError: no such link.
            PlanningError: the link moves relative to the end of the chain.
        """
        if not self.model.has_link(tip_link):
            raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, "link", tip_link, self.model.frame_ids)
        frames = self.model.pin_model.frames
        tip, last = (frames[self.model.frame_ids[name]] for name in (tip_link, self._last_link))
        if tip.parentJoint != last.parentJoint:
            raise PlanningError(ErrorCode.NO_IK_SOLUTION, f"link '{tip_link}' is not rigidly fixed to "
                                f"'{self._last_link}', the end of group '{self.group.name}'; choose a link that is")
        return tip.placement.inverse() * last.placement

    def solutions(self, tip_link: str, target: Transform, seed: Array, timeout_s: float = 0.05,
                  rng: np.random.Generator | None = None) -> list[Array]:
        """Returns all solutions found, as positions of the whole robot, nearest to the seed first.

        Args:
            tip_link: link to bring to the target; rigidly fixed to the end of the group's chain.
            target: pose of the link in the planning frame.
            seed: positions of the whole robot [rad or m]; joints outside the group stay there.
            timeout_s: time the numeric search may take where there is no closed form.
            rng: source of restarts of the numeric search.
        """
        last_in_world = target * self.tip_offset(tip_link)
        data = self.model.pin_model.createData()
        pin.framesForwardKinematics(self.model.pin_model, data, seed)
        base = data.oMf[self.model.frame_ids[self.base_link]]
        if self._analytic is not None:
            candidates = self._analytic.solve(base.inverse() * last_in_world)
            polished = [self._polish(data, seed, item, last_in_world) for item in candidates]
            found = [item for item in polished if item is not None]
        else:
            found = self._numeric(data, seed, last_in_world, timeout_s, rng or np.random.default_rng(0))
        return self._ranked(found, seed)

    def _embed(self, seed: Array, values: Array) -> Array:
        result = np.array(seed)
        result[self.group.indices] = values
        return self.model.with_mimics(result, self._members)

    def _error(self, data: Any, positions: Array, target: Transform) -> tuple[Array, Transform]:
        pin.framesForwardKinematics(self.model.pin_model, data, positions)
        current = data.oMf[self.model.frame_ids[self._last_link]]
        return pin.log6(current.actInv(target)).vector, current

    def _polish(self, data: Any, seed: Array, values: Array, target: Transform,
                steps: int = NEWTON_STEPS) -> Array | None:
        """Drives the pose error of a candidate below the tolerance by Newton steps; None where that fails."""
        if not np.isfinite(values).all():
            return None
        frame = self.model.frame_ids[self._last_link]
        values = values.copy()
        for _ in range(steps):
            positions = self._embed(seed, values)
            error, _ = self._error(data, positions, target)
            size = float(np.linalg.norm(error))
            if size < POSE_TOLERANCE * 0.1:
                return positions
            if size > 0.5 and steps == NEWTON_STEPS:
                return None
            jacobian = pin.computeFrameJacobian(self.model.pin_model, data, positions, frame)[:, self.group.indices]
            damping = min(1.0e-3, size * size) * np.eye(6)
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping, error)
            values = values + step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12))
        positions = self._embed(seed, values)
        error, _ = self._error(data, positions, target)
        return positions if float(np.linalg.norm(error)) < POSE_TOLERANCE else None

    def _numeric(self, data: Any, seed: Array, target: Transform, timeout_s: float,
                 rng: np.random.Generator) -> list[Array]:
        """Searches from the seed, then from random positions, until the time is over or eight were found."""
        deadline = time.monotonic() + timeout_s
        lower, upper = self._search_bounds()
        found: list[Array] = []
        start = np.clip(seed[self.group.indices], lower, upper)
        while len(found) < 8:
            result = self._polish(data, seed, start, target, steps=60)
            if result is not None:
                values = result[self.group.indices]
                if np.all((values >= lower - 1e-9) & (values <= upper + 1e-9)) or len(self._wraps(values)):
                    found.append(result)
            if time.monotonic() > deadline:
                break
            start = rng.uniform(lower, upper)
        return found

    def _search_bounds(self) -> tuple[Array, Array]:
        lower = np.maximum(self.model.lower[self.group.indices], -2.0 * np.pi)
        upper = np.minimum(self.model.upper[self.group.indices], 2.0 * np.pi)
        return lower, upper

    def _wraps(self, values: Array) -> Array:
        """Returns the vector and all turns of its rotary joints that are within bounds, shape (n, joints)."""
        choices = [self._turns(int(number), float(value))
                   for number, value in zip(self.group.indices, values, strict=True)]
        rows = list(itertools.islice(itertools.product(*choices), MAX_WRAPS))
        return np.array(rows, dtype=float).reshape(len(rows), len(values))

    def _turns(self, number: int, value: float) -> list[float]:
        """Returns a joint's value and what differs from it by whole turns, within bounds."""
        lower, upper = float(self.model.lower[number]) - 1e-9, float(self.model.upper[number]) + 1e-9
        if self.model.document.joint_kinds[self.model.joint_names[number]] == "prismatic":
            return [value] if lower <= value <= upper else []
        if self.model.is_continuous(number):
            return [value + turn * 2.0 * np.pi for turn in (-1, 0, 1)]
        first = math.ceil((lower - value) / (2.0 * math.pi))
        last = math.floor((upper - value) / (2.0 * math.pi))
        return [min(max(value + turn * 2.0 * math.pi, lower + 1e-9), upper - 1e-9) for turn in range(first, last + 1)]

    def _ranked(self, found: list[Array], seed: Array) -> list[Array]:
        """Drops duplicates, adds turns and puts the nearest to the seed first."""
        indices = self.group.indices
        unique: list[Array] = []
        for positions in found:
            values = positions[indices]
            if all(np.abs(np.angle(np.exp(1j * (values - other)))).max() > SAME_SOLUTION for other in unique):
                unique.append(values)
        if not unique:
            return []
        rows = np.vstack([self._wraps(values) for values in unique])
        order = np.argsort(np.linalg.norm(rows - seed[indices], axis=1), kind="stable")
        result = np.tile(np.asarray(seed, dtype=float), (len(order), 1))
        result[:, indices] = rows[order]
        for follower, leader, multiplier, offset in self.model.mimics:
            if leader in self._members:
                result[:, follower] = multiplier * result[:, leader] + offset
        return list(result)

    def explain_unreachable(self, tip_link: str, target: Transform, seed: Array) -> str:
        """Says why a pose has no solution: too far away, or only out of joint bounds."""
        transforms = self.model.link_transforms(seed)
        last = target * self.tip_offset(tip_link)
        shoulder = transforms[self.model.document.joint_children[self.group.joints[0]]]
        distance = float(np.linalg.norm(last.translation - shoulder.translation))
        where = np.array2string(target.translation, precision=3, separator=", ")
        if distance > self.reach:
            return (f"no inverse kinematics for '{tip_link}' at {where} m: out of reach, '{self._last_link}' would be "
                    f"{distance:.3f} m from the shoulder and the arm reaches at most {self.reach:.3f} m")
        return (f"no inverse kinematics for '{tip_link}' at {where} m: '{self._last_link}' would be {distance:.3f} m "
                f"from the shoulder (at most {self.reach:.3f} m), but no joint positions within the bounds of group "
                f"'{self.group.name}' give this orientation there")


def first_free(candidates: list[Array], is_free: Callable[[Array], bool], most: int = 1) -> list[Array]:
    """Returns the first candidates that are free, in their order.

    Whole turns of a joint look the same to every obstacle, so each posture is checked once.
    """
    verdicts: dict[bytes, bool] = {}
    free: list[Array] = []
    for values in candidates:
        key = np.round(np.exp(1j * values), 4).tobytes()
        if key not in verdicts:
            verdicts[key] = is_free(values)
        if verdicts[key]:
            free.append(values)
            if len(free) >= most:
                break
    return free


class KinematicsPool:
    """Builds the solver of each group once."""

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self._solvers: dict[str, InverseKinematics] = {}

    def solver(self, group: str) -> InverseKinematics:
        """Returns the solver of a group; raises PlanningError for a group that is not a chain."""
        if group not in self._solvers:
            self._solvers[group] = InverseKinematics(self._model, self._model.group(group))
        return self._solvers[group]

