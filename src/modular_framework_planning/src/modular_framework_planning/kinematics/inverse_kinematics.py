# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of a link: all closed-form solutions where there is a closed form, else a numeric search."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from numpy.random import Generator
from numpy.typing import NDArray

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.chain_model import BALL_GAIN, ChainModel, with_ball_joint
from modular_framework_planning.kinematics.closed_form import ClosedForm
from modular_framework_planning.kinematics.compiled_kinematics import (
    Chain,
    approach_seed,
    polish,
    search,
    unique_rows,
    whole_turns,
)
from modular_framework_planning.kinematics.kinematics_settings import (
    CLOSED_FORM,
    CLOSED_FORM_AND_SEARCH,
    NUMERIC,
    KinematicsSettings,
)
from modular_framework_planning.robot_model.multi_dof_joint import UNBOUNDED_M
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

ACCURACY = 1.0e-8  # what the compiled steps are asked for
SAME_SOLUTION = 1.0e-5  # [rad or m]
BOUND_SLACK = 0.05  # [rad]; how far out of bounds a candidate may be before it is polished
COARSEST_SWEEP = 0.4  # [rad]; first step of the held joint of a seven-joint chain, halved while nothing is found
FURTHEST_CANDIDATE = 0.5  # pose error of a closed-form candidate above which it is no solution
MAX_TURNS = 4096
POLISH_STEPS, SEARCH_STEPS, APPROACH_STEPS = 10, 25, 20
STARTS_A_BATCH = 4
MIN_BATCHES = 8  # tried even after the timeout, so that a busy machine does not report reachable poses as unreachable
FRUITLESS_BATCHES = 32  # the numeric search ends after so many batches without a new solution
ENOUGH, ENOUGH_REDUNDANT = 16, 8  # solutions of the numeric search
APPROACHED = 4  # solutions of a redundant chain that are moved nearer to the seed


class InverseKinematics:
    """Solves for one group of the robot; safe to share between threads."""

    def __init__(
        self,
        model: RobotModel,
        group: JointGroup,
        settings: KinematicsSettings = KinematicsSettings(),  # noqa: B008 - frozen
    ) -> None:
        if not group.is_chain:
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"group '{group.name}' is not a chain of joints; inverse "
                "kinematics needs a chain from a base link to a tip link",
            )
        self.model, self.group, self.settings = model, group, settings
        self._members = frozenset(int(number) for number in group.indices)
        self._last_link = model.document.joint_children[group.joints[-1]]
        self.base_link = model.document.joint_parents[group.joints[0]]
        self._chain = ChainModel(model, group, self._last_link)
        self._turning = np.array([model.document.joint_kinds[name] != "prismatic" for name in group.joints])
        self._is_continuous = np.array([model.is_continuous(int(number)) for number in group.indices])
        self._closed = self._try_closed_form()
        self.reach = self._max_reach()

    @property
    def method(self) -> str:
        """The method that solves: `NUMERIC`, `CLOSED_FORM` or `CLOSED_FORM_AND_SEARCH`."""
        if self._closed is None:
            return NUMERIC
        return CLOSED_FORM if self._closed.locked is None else CLOSED_FORM_AND_SEARCH

    @property
    def finds_all(self) -> bool:
        """Whether no solution is missed: a closed form gives them all."""
        return self._closed is not None and self._closed.locked is None and not self.settings.position_only

    def _try_closed_form(self) -> ClosedForm | None:
        between = [
            name for name in self.model.chain_joints(self.base_link, self._last_link) if name in self.model.index
        ]
        if self.settings.solver == NUMERIC or between != list(self.group.joints):
            return None
        try:
            return ClosedForm(self.model, self.group, self.base_link, self._last_link)
        except PlanningError:
            return None

    def _max_reach(self) -> float:
        """Returns an upper bound of the distance from the first joint to the last joint's link [m]."""
        pin_model = self.model.pin_model
        numbers = [pin_model.getJointId(name) for name in self.group.joints]
        steps = sum(float(np.linalg.norm(pin_model.jointPlacements[number].translation)) for number in numbers[1:])
        sliding = self.group.indices[~self._turning]
        return steps + float(np.maximum(np.abs(self.model.lower), np.abs(self.model.upper))[sliding].sum())

    def tip_offset(self, tip_link: str, positions: Array) -> Transform:
        """Returns the pose of the last joint's link in the frame of a tip; only fixed and passive joints lie between.

        Args:
            tip_link: name of the tip.
            positions: of the whole robot, for the passive joints, which stay there [rad or m].

        Raises:
            UnknownNameError: no such link.
            PlanningError: a joint that is not passive moves the link relative to the end of the chain.
        """
        if not self.model.has_link(tip_link):
            raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, "link", tip_link, self.model.frame_ids)
        if not self.model.is_carried(tip_link, self._last_link):
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"link '{tip_link}' is not rigidly fixed to "
                f"'{self._last_link}', the end of group '{self.group.name}'; choose a link that is",
            )
        tip, last = (self.model.pin_model.frames[self.model.frame_ids[name]] for name in (tip_link, self._last_link))
        if tip.parentJoint == last.parentJoint:
            return tip.placement.inverse() * last.placement
        transforms = self.model.link_transforms(positions)
        return transforms[tip_link].actInv(transforms[self._last_link])

    def solutions(
        self,
        tip_link: str,
        target: Transform,
        seed: Array,
        timeout_s: float | None = None,
        rng: Generator | None = None,
        bounds: tuple[Array, Array] | None = None,
    ) -> list[Array]:
        """Returns all solutions found, as positions of the whole robot, nearest to the seed first.

        Args:
            tip_link: link to bring to the target; see tip_offset.
            target: pose of the link in the planning frame.
            seed: positions of the whole robot [rad or m]; joints outside the group stay there.
            timeout_s: time the search may take where there is no closed form; the group's by default. With
                math.inf only the numbers of tries bound the search.
            rng: source of restarts of the numeric search.
            bounds: lower and upper bounds of the group's joints [rad or m]; those of the robot by default.
        """
        problem = self._problem(target * self.tip_offset(tip_link, seed), seed, timeout_s, bounds)
        found = self._from_closed_form(problem)
        if not len(found):
            found = self._from_search(problem, rng or np.random.default_rng(0))
        return self._ranked(problem, found)

    def position_solutions(
        self, tip_link: str, point: Array, position: Array, seed: Array, timeout_s: float | None = None
    ) -> list[Array]:
        """As `solutions`, for the position of a point alone; the orientation is left open, and kept where it can be.

        Args:
            tip_link: link that carries the point; see tip_offset.
            point: in the link's frame (3,) [m].
            position: where the point shall be, in the planning frame (3,) [m].
            seed: as for `solutions`.
            timeout_s: as for `solutions`.
        """
        joint = self.tip_offset(tip_link, seed).inverse() * pin.SE3(np.eye(3), np.asarray(point, dtype=float))
        turn = self.model.link_transforms(seed)[tip_link].rotation
        target = pin.SE3(turn, np.asarray(position, dtype=float))
        problem = self._problem(target, seed, timeout_s).with_ball_joint(joint)
        return self._ranked(problem, self._from_search(problem, np.random.default_rng(0)))

    def _problem(
        self,
        target: Transform,
        seed: Array,
        timeout_s: float | None = None,
        bounds: tuple[Array, Array] | None = None,
    ) -> _Problem:
        allowed = self.settings.total_timeout_s if timeout_s is None else timeout_s
        return _Problem(
            self._chain.at(seed),
            target,
            np.asarray(seed, dtype=float),
            np.array(seed[self.group.indices], dtype=float),
            *self._bounds(target, seed, bounds),
            self._turning,
            time.monotonic() + allowed,
        )

    def _bounds(self, target: Transform, seed: Array, bounds: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Returns the bounds of the group's joints; those without ends get three turns around the seed.

        A base without bounds gets twice the way from where the end of the chain is to the target, and two metres.
        """
        values = seed[self.group.indices]
        lower, upper = bounds or (self.model.lower[self.group.indices], self.model.upper[self.group.indices])
        reach = np.where(self._is_continuous, 3.0 * np.pi, np.inf)
        endless = ~self._is_continuous & (upper >= UNBOUNDED_M)
        if endless.any():
            gap = target.translation - self.model.link_transforms(seed)[self._last_link].translation
            reach[endless] = 2.0 * float(np.linalg.norm(gap)) + 2.0
        return np.maximum(lower, values - reach), np.minimum(upper, values + reach)

    def _from_closed_form(self, problem: _Problem) -> Array:
        """Returns the closed form's solutions within bounds, whole turns included, shape (k, joints)."""
        if self._closed is None:
            return np.empty((0, len(self.group.joints)))
        base = (
            self.model.link_transforms(problem.full_seed)[self.base_link]
            if not self._chain.is_own
            else (self._fixed_base())
        )
        in_base = base.actInv(problem.target)
        if self._closed.locked is None:
            return self._polished(problem, self._closed.solve(in_base))
        half = 0.5 * (time.monotonic() + problem.deadline)  # the other half of the time is for the numeric search
        step, found = COARSEST_SWEEP, np.empty((0, len(self.group.joints)))
        tried: Array = np.empty(0)
        while not len(found) and step >= self.settings.search_resolution and time.monotonic() < half:
            values = np.setdiff1d(self._held_values(problem, step), tried)
            tried = np.concatenate([tried, values])
            found = self._polished(problem, np.vstack([self._closed.solve(in_base, value) for value in values]))
            step *= 0.5
        return found

    def _fixed_base(self) -> Transform:
        frame = self.model.pin_model.frames[self.model.frame_ids[self.base_link]]
        return frame.placement

    def _held_values(self, problem: _Problem, step: float) -> Array:
        """Returns values of the held joint: the seed's, and a grid over its bounds."""
        assert self._closed is not None and self._closed.locked is not None
        number = self._closed.locked
        at, low, high = problem.seed[number], problem.lower[number], problem.upper[number]
        if self._is_continuous[number]:
            low, high = at - np.pi, at + np.pi
        grid = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)
        return np.append(grid, np.clip(at, low, high))

    def _polished(self, problem: _Problem, candidates: Array) -> Array:
        """Returns the candidates that Newton steps bring to the target, without those that are out of bounds."""
        excess = candidates - (problem.upper + BOUND_SLACK)
        lowered = candidates - np.where(self._turning, 2.0 * np.pi * np.ceil(excess / (2.0 * np.pi)), 0.0)
        candidates = candidates[(lowered >= problem.lower - BOUND_SLACK).all(axis=1)]
        if not len(candidates):
            return candidates
        endless = np.full(candidates.shape[1], np.inf)
        arrived = polish(
            problem.chain, candidates, problem.pose, -endless, endless, ACCURACY, FURTHEST_CANDIDATE, POLISH_STEPS
        )
        rows = candidates[arrived]
        rows = rows[unique_rows(rows, self._turning, SAME_SOLUTION)]
        return whole_turns(rows, self._turning, problem.lower, problem.upper, MAX_TURNS)

    def _from_search(self, problem: _Problem, rng: Generator) -> Array:
        """Searches from the seed, then from random positions, until there are enough, no new ones, or no time left."""
        reach = np.where(problem.turning, 2.0 * np.pi, np.inf)
        lower, upper = np.maximum(problem.lower, problem.seed - reach), np.minimum(problem.upper, problem.seed + reach)
        found = np.empty((0, len(lower)))
        fruitless, batches, enough = 0, 0, ENOUGH if len(lower) <= 6 else ENOUGH_REDUNDANT
        starts = np.clip(problem.seed, lower, upper)[None, :]
        while fruitless < FRUITLESS_BATCHES and len(found) < enough:
            arrived = search(problem.chain, starts, problem.pose, lower, upper, ACCURACY, SEARCH_STEPS, enough)
            rows = np.vstack([found, starts[arrived]])
            rows = rows[unique_rows(rows, problem.turning, SAME_SOLUTION)]
            fruitless = fruitless + 1 if len(rows) == len(found) else 0
            found, batches = rows, batches + 1
            if time.monotonic() > problem.deadline and (len(found) or batches >= MIN_BATCHES):
                break
            starts = rng.uniform(lower, upper, (STARTS_A_BATCH, len(lower)))
        return whole_turns(found, problem.turning, problem.lower, problem.upper, MAX_TURNS)

    def _ranked(self, problem: _Problem, found: Array) -> list[Array]:
        """Puts the nearest to the seed first; returns positions of the whole robot."""
        if not len(found):
            return []
        rows = found[np.argsort(np.linalg.norm(found - problem.seed, axis=1), kind="stable")]
        if rows.shape[1] > 6:
            rows = self._approached(problem, rows)
        if rows.shape[1] > min(6, len(self.group.joints)):
            rows = rows[:, : len(self.group.joints)]  # without those of a ball joint
            distances = np.linalg.norm(rows - problem.seed[: rows.shape[1]], axis=1)
            rows = rows[np.argsort(distances, kind="stable")]
        result = np.tile(problem.full_seed, (len(rows), 1))
        result[:, self.group.indices] = rows
        for follower, leader, multiplier, offset in self.model.mimics:
            if leader in self._members:
                result[:, follower] = multiplier * result[:, leader] + offset
        return list(result)

    @staticmethod
    def _approached(problem: _Problem, rows: Array) -> Array:
        """Adds solutions of a redundant chain that were moved nearer to the seed."""
        nearer = rows[:APPROACHED].copy()
        for values in nearer:
            approach_seed(
                problem.chain,
                values,
                problem.seed,
                problem.pose,
                problem.lower,
                problem.upper,
                ACCURACY,
                APPROACH_STEPS,
            )
        rows = np.vstack([nearer, rows])
        rows = rows[unique_rows(rows, np.zeros(rows.shape[1], dtype=bool), SAME_SOLUTION)]
        return rows[np.argsort(np.linalg.norm(rows - problem.seed, axis=1), kind="stable")]

    def explain_unreachable(self, tip_link: str, target: Transform, seed: Array) -> str:
        """Says why a pose has no solution: too far away, or only out of joint bounds."""
        transforms = self.model.link_transforms(seed)
        last = target * self.tip_offset(tip_link, seed)
        shoulder = transforms[self.model.document.joint_children[self.group.joints[0]]]
        distance = float(np.linalg.norm(last.translation - shoulder.translation))
        where = np.array2string(target.translation, precision=3, separator=", ")
        if distance > self.reach:
            return (
                f"no inverse kinematics for '{tip_link}' at {where} m: out of reach, '{self._last_link}' would be "
                f"{distance:.3f} m from the shoulder and the arm reaches at most {self.reach:.3f} m"
            )
        return (
            f"no inverse kinematics for '{tip_link}' at {where} m: '{self._last_link}' would be {distance:.3f} m "
            f"from the shoulder (at most {self.reach:.3f} m), but no joint positions within the bounds of group "
            f"'{self.group.name}' give this orientation there"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """One pose to solve: the last link's target, the seed of the whole robot and of the group, the group's bounds."""

    chain: Chain
    target: Transform
    full_seed: Array
    seed: Array
    lower: Array
    upper: Array
    turning: NDArray[np.bool_]
    deadline: float
    pose: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", np.ascontiguousarray(self.target.homogeneous[:3]))

    def with_ball_joint(self, joint: Transform) -> _Problem:
        """Returns the problem with a ball joint, at a pose in the last link's frame, that takes up the orientation."""
        reach = np.full(3, np.pi / BALL_GAIN)
        return replace(
            self,
            chain=with_ball_joint(self.chain, joint.homogeneous, len(self.seed)),
            seed=np.append(self.seed, np.zeros(3)),
            lower=np.append(self.lower, -reach),
            upper=np.append(self.upper, reach),
            turning=np.append(self.turning, np.zeros(3, dtype=bool)),
        )


class KinematicsPool:
    """Builds the solver of each group once."""

    def __init__(self, model: RobotModel, settings: Mapping[str, KinematicsSettings] | None = None) -> None:
        """Stores what solvers are built from.

        Args:
            model: the robot.
            settings: by name of the group.
        """
        self._model = model
        self._settings = dict(settings or {})
        self._solvers: dict[str, InverseKinematics] = {}

    def solver(self, group: str) -> InverseKinematics:
        """Returns the solver of a group; raises PlanningError for a group that is not a chain."""
        if group not in self._solvers:
            settings = self._settings.get(group, KinematicsSettings())
            self._solvers[group] = InverseKinematics(self._model, self._model.group(group), settings)
        return self._solvers[group]
