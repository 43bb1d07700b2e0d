# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of a link: all solutions if a closed form exists, otherwise a numeric search."""

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
    full_rotations,
    polish,
    search,
    unique_rows,
)
from modular_framework_planning.kinematics.kinematics_settings import (
    CLOSED_FORM,
    CLOSED_FORM_AND_SEARCH,
    NUMERIC,
    KinematicsSettings,
)
from modular_framework_planning.robot_model.multi_dof_joint import UNBOUNDED_M
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

ACCURACY = 1.0e-8  # tolerance of the pose error norm
SAME_SOLUTION = 1.0e-5  # [rad or m]
BOUNDS_MARGIN = 0.05  # bounds violation of a candidate that polishing can correct [rad]
INITIAL_SWEEP_STEP = 0.4  # step of the locked joint of a seven-joint chain, halved until a solution is found [rad]
MAX_CANDIDATE_ERROR = 0.5  # pose error norm above which a closed-form candidate is rejected
MAX_ROTATED_SOLUTIONS = 4096
POLISH_STEPS, SEARCH_STEPS, APPROACH_STEPS = 10, 25, 20
STARTS_PER_BATCH = 4
MIN_BATCHES = 8  # tried even after the timeout, so that a busy machine does not report reachable poses as unreachable
MAX_FRUITLESS_BATCHES = 32  # the numeric search ends after this number of consecutive batches without a new solution
MAX_SOLUTIONS, MAX_REDUNDANT_SOLUTIONS = 16, 8  # limits of the numeric search
MAX_SEED_APPROACHES = 4  # solutions of a redundant chain that are moved closer to the seed


class InverseKinematics:
    """Inverse kinematics solver of a group; thread-safe."""

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
        self._members = frozenset(int(joint_id) for joint_id in group.indices)
        self._last_link = model.document.joint_children[group.joints[-1]]
        self.base_link = model.document.joint_parents[group.joints[0]]
        self._chain = ChainModel(model, group, self._last_link)
        self._is_revolute = np.array([model.document.joint_kinds[name] != "prismatic" for name in group.joints])
        self._is_continuous = np.array([model.is_continuous(int(joint_id)) for joint_id in group.indices])
        self._closed_form = self._try_closed_form()
        self.reach = self._max_reach()

    @property
    def method(self) -> str:
        """Inverse kinematics method: `NUMERIC`, `CLOSED_FORM` or `CLOSED_FORM_AND_SEARCH`."""
        if self._closed_form is None:
            return NUMERIC
        return CLOSED_FORM if self._closed_form.locked_joint is None else CLOSED_FORM_AND_SEARCH

    def is_complete(self, tip_link: str, target: Transform, seed: Array) -> bool:
        """Returns whether `solutions` finds all solutions of a target.

        A closed form of six joints finds all solutions, unless the wrist or the shoulder is singular and has infinitely
        many solutions.

        Args:
            tip_link: Link to bring to the target, see tip_offset.
            target: Target pose of the link in the planning frame.
            seed: Positions of the whole robot [rad or m].
        """
        closed_form = self._closed_form
        if closed_form is None or closed_form.locked_joint is not None or self.settings.position_only:
            return False
        problem = self._problem(target * self.tip_offset(tip_link, seed), seed)
        in_base = self._target_in_base(problem)
        if closed_form.has_singular_shoulder(in_base):
            return False
        return not closed_form.has_aligned_wrist(closed_form.solve(in_base)).any()

    def _try_closed_form(self) -> ClosedForm | None:
        chain_joints_between = [
            name for name in self.model.tree.chain(self.base_link, self._last_link) if name in self.model.index
        ]
        if self.settings.solver == NUMERIC or chain_joints_between != list(self.group.joints):
            return None
        try:
            return ClosedForm(self.model, self.group, self.base_link, self._last_link)
        except PlanningError:
            return None

    def _max_reach(self) -> float:
        """Returns an upper bound of the distance from the group's first joint to the last link [m].

        The path between them includes mimic and passive joints, which are not in the group.
        """
        model, path = self.model, self._chain.positions.tolist()
        path = path[path.index(int(self.group.indices[0])) :]
        steps = sum(float(np.linalg.norm(model.pin_model.jointPlacements[joint + 1].translation)) for joint in path[1:])
        sliding = [joint for joint in path if model.document.joint_kinds[model.joint_names[joint]] == "prismatic"]
        return steps + float(np.maximum(np.abs(model.lower), np.abs(model.upper))[sliding].sum())

    def tip_offset(self, tip_link: str, positions: Array) -> Transform:
        """Returns the pose of the chain's last link in the frame of a tip link.

        Args:
            tip_link: Tip link, connected to the last link by fixed and passive joints only.
            positions: Positions of the whole robot, for the passive joints [rad or m].

        Raises:
            UnknownNameError: The link does not exist.
            PlanningError: An active joint moves the tip link relative to the last link.
        """
        if not self.model.has_link(tip_link):
            raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, "link", tip_link, self.model.frame_ids)
        if not self.model.is_carried(tip_link, self._last_link):
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"link '{tip_link}' is not rigidly fixed to '{self._last_link}', the last link of group "
                f"'{self.group.name}'; choose a link that is rigidly fixed to it",
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
        *,
        timeout_s: float | None = None,
        rng: Generator | None = None,
        bounds: tuple[Array, Array] | None = None,
    ) -> list[Array]:
        """Returns all solutions found, as positions of the whole robot, nearest to the seed first.

        Args:
            tip_link: Link to bring to the target, see tip_offset.
            target: Target pose of the link in the planning frame.
            seed: Positions of the whole robot, kept by joints outside the group [rad or m].
            timeout_s: Timeout of the numeric search [s]; None for the group's timeout, math.inf to bound the search by
                the number of attempts only.
            rng: Random generator of the numeric search.
            bounds: Lower and upper bounds of the group's joints [rad or m]; None for the bounds of the robot.
        """
        problem = self._problem(target * self.tip_offset(tip_link, seed), seed, timeout_s, bounds)
        solutions = self._from_closed_form(problem)
        if not len(solutions):
            solutions = self._from_search(problem, rng or np.random.default_rng(0))
        return self._ranked_solutions(problem, solutions)

    def position_solutions(
        self, tip_link: str, point: Array, position: Array, seed: Array, timeout_s: float | None = None
    ) -> list[Array]:
        """Returns solutions that place a point of a link at a position; the seed's orientation is kept if possible.

        Args:
            tip_link: Link with the point, see tip_offset.
            point: Point in the link frame, shape (3,) [m].
            position: Target position in the planning frame, shape (3,) [m].
            seed: Positions of the whole robot, see `solutions`.
            timeout_s: Timeout of the numeric search, see `solutions`.
        """
        joint = self.tip_offset(tip_link, seed).inverse() * pin.SE3(np.eye(3), np.asarray(point, dtype=float))
        rotation = self.model.link_transforms(seed)[tip_link].rotation
        target = pin.SE3(rotation, np.asarray(position, dtype=float))
        problem = self._problem(target, seed, timeout_s).with_ball_joint(joint)
        return self._ranked_solutions(problem, self._from_search(problem, np.random.default_rng(0)))

    def _problem(
        self,
        target: Transform,
        seed: Array,
        timeout_s: float | None = None,
        bounds: tuple[Array, Array] | None = None,
    ) -> _Problem:
        timeout = self.settings.total_timeout_s if timeout_s is None else timeout_s
        return _Problem(
            self._chain.with_positions(seed),
            target,
            np.asarray(seed, dtype=float),
            np.array(seed[self.group.indices], dtype=float),
            *self._bounds(target, seed, bounds),
            self._is_revolute,
            time.monotonic() + timeout,
        )

    def _bounds(self, target: Transform, seed: Array, bounds: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """Returns the bounds of the group's joints; continuous joints get a range of three rotations around the seed.

        An unbounded base may move by twice the distance between the end of the chain and the target, plus two metres.
        """
        values = seed[self.group.indices]
        lower, upper = bounds or (self.model.lower[self.group.indices], self.model.upper[self.group.indices])
        reach = np.where(self._is_continuous, 3.0 * np.pi, np.inf)
        is_unbounded = ~self._is_continuous & (upper >= UNBOUNDED_M)
        if is_unbounded.any():
            gap = target.translation - self.model.link_transforms(seed)[self._last_link].translation
            reach[is_unbounded] = 2.0 * float(np.linalg.norm(gap)) + 2.0
        return np.maximum(lower, values - reach), np.minimum(upper, values + reach)

    def _from_closed_form(self, problem: _Problem) -> Array:
        """Returns the closed-form solutions within bounds, and their copies shifted by 2 pi, shape (k, joints)."""
        if self._closed_form is None:
            return np.empty((0, len(self.group.joints)))
        in_base = self._target_in_base(problem)
        if self._closed_form.locked_joint is None:
            candidates = self._closed_form.solve(in_base)
            solutions = self._polished_solutions(problem, candidates)
            is_singular = self._closed_form.has_aligned_wrist(candidates)
            has_singular_shoulder = self._closed_form.has_singular_shoulder(in_base)
            if has_singular_shoulder or is_singular.any():
                starts = candidates if has_singular_shoulder else candidates[is_singular]
                solutions = np.vstack([solutions, self._singular_solutions(problem, starts)])
            return solutions
        sweep_deadline = 0.5 * (
            time.monotonic() + problem.deadline
        )  # the second half of the time is for the numeric search
        step, solutions = INITIAL_SWEEP_STEP, np.empty((0, len(self.group.joints)))
        tried_values: Array = np.empty(0)
        while not len(solutions) and step >= self.settings.search_resolution and time.monotonic() < sweep_deadline:
            values = np.setdiff1d(self._locked_values(problem, step), tried_values)
            tried_values = np.concatenate([tried_values, values])
            solutions = self._polished_solutions(
                problem, np.vstack([self._closed_form.solve(in_base, value) for value in values])
            )
            step *= 0.5
        return solutions

    def _target_in_base(self, problem: _Problem) -> Transform:
        if not self._chain.is_independent:
            return self.model.link_transforms(problem.full_seed)[self.base_link].actInv(problem.target)
        frame = self.model.pin_model.frames[self.model.frame_ids[self.base_link]]
        return frame.placement.actInv(problem.target)

    def _singular_solutions(self, problem: _Problem, candidates: Array) -> Array:
        """Returns solutions near the seed and near the candidates of a singular pose, shape (k, joints)."""
        starts = np.clip(np.vstack([problem.seed, candidates]), problem.lower, problem.upper)
        arrived = search(
            problem.chain,
            starts,
            problem.pose,
            problem.lower,
            problem.upper,
            ACCURACY,
            SEARCH_STEPS,
            len(starts),
        )
        rows = starts[arrived]
        rows = rows[unique_rows(rows, problem.is_revolute, SAME_SOLUTION)]
        return full_rotations(rows, problem.is_revolute, problem.lower, problem.upper, MAX_ROTATED_SOLUTIONS)

    def _locked_values(self, problem: _Problem, step: float) -> Array:
        """Returns values of the locked joint: a grid over its bounds, and the value of the seed."""
        assert self._closed_form is not None and self._closed_form.locked_joint is not None
        joint_id = self._closed_form.locked_joint
        seed_value, low, high = problem.seed[joint_id], problem.lower[joint_id], problem.upper[joint_id]
        if self._is_continuous[joint_id]:
            low, high = seed_value - np.pi, seed_value + np.pi
        grid = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)
        return np.append(grid, np.clip(seed_value, low, high))

    def _polished_solutions(self, problem: _Problem, candidates: Array) -> Array:
        """Returns the refined candidates that reach the target within bounds, and their copies shifted by 2 pi."""
        excess = candidates - (problem.upper + BOUNDS_MARGIN)
        wrapped = candidates - np.where(self._is_revolute, 2.0 * np.pi * np.ceil(excess / (2.0 * np.pi)), 0.0)
        candidates = candidates[(wrapped >= problem.lower - BOUNDS_MARGIN).all(axis=1)]
        if not len(candidates):
            return candidates
        is_unbounded = np.full(candidates.shape[1], np.inf)
        arrived = polish(
            problem.chain,
            candidates,
            problem.pose,
            -is_unbounded,
            is_unbounded,
            ACCURACY,
            MAX_CANDIDATE_ERROR,
            POLISH_STEPS,
        )
        rows = candidates[arrived]
        rows = rows[unique_rows(rows, self._is_revolute, SAME_SOLUTION)]
        return full_rotations(rows, self._is_revolute, problem.lower, problem.upper, MAX_ROTATED_SOLUTIONS)

    def _from_search(self, problem: _Problem, rng: Generator) -> Array:
        """Searches from the seed and from random positions until the timeout or enough solutions."""
        reach = np.where(problem.is_revolute, 2.0 * np.pi, np.inf)
        lower, upper = np.maximum(problem.lower, problem.seed - reach), np.minimum(problem.upper, problem.seed + reach)
        solutions = np.empty((0, len(lower)))
        fruitless, batches, max_solutions = 0, 0, MAX_SOLUTIONS if len(lower) <= 6 else MAX_REDUNDANT_SOLUTIONS
        starts = np.clip(problem.seed, lower, upper)[None, :]
        while fruitless < MAX_FRUITLESS_BATCHES and len(solutions) < max_solutions:
            arrived = search(problem.chain, starts, problem.pose, lower, upper, ACCURACY, SEARCH_STEPS, max_solutions)
            rows = np.vstack([solutions, starts[arrived]])
            rows = rows[unique_rows(rows, problem.is_revolute, SAME_SOLUTION)]
            fruitless = fruitless + 1 if len(rows) == len(solutions) else 0
            solutions, batches = rows, batches + 1
            if time.monotonic() > problem.deadline and (len(solutions) or batches >= MIN_BATCHES):
                break
            starts = rng.uniform(lower, upper, (STARTS_PER_BATCH, len(lower)))
        return full_rotations(solutions, problem.is_revolute, problem.lower, problem.upper, MAX_ROTATED_SOLUTIONS)

    def _ranked_solutions(self, problem: _Problem, solutions: Array) -> list[Array]:
        """Returns solutions as positions of the whole robot, nearest to the seed first."""
        if not len(solutions):
            return []
        rows = solutions[np.argsort(np.linalg.norm(solutions - problem.seed, axis=1), kind="stable")]
        if rows.shape[1] > 6:
            rows = self._with_copies_near_seed(problem, rows)
        if rows.shape[1] > min(6, len(self.group.joints)):
            rows = rows[:, : len(self.group.joints)]  # removes the columns of a ball joint
            distances = np.linalg.norm(rows - problem.seed[: rows.shape[1]], axis=1)
            rows = rows[np.argsort(distances, kind="stable")]
        result = np.tile(problem.full_seed, (len(rows), 1))
        result[:, self.group.indices] = rows
        for follower, leader, multiplier, offset in self.model.mimics:
            if leader in self._members:
                result[:, follower] = multiplier * result[:, leader] + offset
        return list(result)

    @staticmethod
    def _with_copies_near_seed(problem: _Problem, rows: Array) -> Array:
        """Adds copies of the best solutions of a redundant chain, moved closer to the seed; sorts by seed distance."""
        approached = rows[:MAX_SEED_APPROACHES].copy()
        for values in approached:
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
        rows = np.vstack([approached, rows])
        rows = rows[unique_rows(rows, np.zeros(rows.shape[1], dtype=bool), SAME_SOLUTION)]
        return rows[np.argsort(np.linalg.norm(rows - problem.seed, axis=1), kind="stable")]

    def explain_unreachable(self, tip_link: str, target: Transform, seed: Array) -> str:
        """Explains why a pose has no solution: out of reach, or impossible within joint bounds.

        Args:
            tip_link: Link to bring to the target.
            target: Target pose of the link in the planning frame.
            seed: Positions of the whole robot [rad or m].
        """
        transforms = self.model.link_transforms(seed)
        last = target * self.tip_offset(tip_link, seed)
        shoulder = transforms[self.model.document.joint_children[self.group.joints[0]]]
        distance = float(np.linalg.norm(last.translation - shoulder.translation))
        position = np.array2string(target.translation, precision=3, separator=", ")
        if distance > self.reach:
            return (
                f"no inverse kinematics for '{tip_link}' at {position} m: out of reach, because '{self._last_link}' "
                f"would be {distance:.3f} m from the shoulder and the arm reaches at most {self.reach:.3f} m"
            )
        return (
            f"no inverse kinematics for '{tip_link}' at {position} m: '{self._last_link}' would be {distance:.3f} m "
            f"from the shoulder (at most {self.reach:.3f} m), but no joint positions within the bounds of group "
            f"'{self.group.name}' reach this orientation"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Target pose of the last link, seeds of the whole robot and of the group, and bounds of the group."""

    chain: Chain
    target: Transform
    full_seed: Array
    seed: Array
    lower: Array
    upper: Array
    is_revolute: NDArray[np.bool_]
    deadline: float
    pose: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", np.ascontiguousarray(self.target.homogeneous[:3]))

    def with_ball_joint(self, joint: Transform) -> _Problem:
        """Returns the problem with an added ball joint, which makes the orientation of the link free."""
        reach = np.full(3, np.pi / BALL_GAIN)
        return replace(
            self,
            chain=with_ball_joint(self.chain, joint.homogeneous, len(self.seed)),
            seed=np.append(self.seed, np.zeros(3)),
            lower=np.append(self.lower, -reach),
            upper=np.append(self.upper, reach),
            is_revolute=np.append(self.is_revolute, np.zeros(3, dtype=bool)),
        )


class KinematicsPool:
    """Creates the kinematics solver of each group once."""

    def __init__(self, model: RobotModel, settings: Mapping[str, KinematicsSettings] | None = None) -> None:
        """Stores the arguments.

        Args:
            model: Robot model.
            settings: Kinematics settings, keyed by group name.
        """
        self.model = model
        self._settings = dict(settings or {})
        self._solvers: dict[str, InverseKinematics] = {}

    def solver(self, group: str) -> InverseKinematics:
        """Returns the solver of a group; raises PlanningError for a group that is not a chain."""
        if group not in self._solvers:
            settings = self._settings.get(group, KinematicsSettings())
            self._solvers[group] = InverseKinematics(self.model, self.model.group(group), settings)
        return self._solvers[group]
