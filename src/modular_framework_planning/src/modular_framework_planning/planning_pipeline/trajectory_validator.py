# SPDX-License-Identifier: BSD-3-Clause
"""The solution validator of every pipeline: it checks each motion, whatever planner and adapters made it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from modular_framework_planning.contacts import describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.path_repair import describe_state
from modular_framework_planning.planning_interface.phase_times import CHECK
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, PlanningProblem
from modular_framework_planning.trajectory_processing.path_shortening import without_repeats

SAMPLES_AT_ONCE = 200  # of a motion, between two checks of the time
GRACE_S = 0.2  # after the allowed time, in which a check that has begun may end


class TrajectoryValidator:
    """Checks the curve of a timed motion and the straight lines between its points.

    A motion that has passed is not checked twice.
    """

    def __init__(self) -> None:
        self._passed: dict[bytes, CollisionChecker] = {}  # by motion; a checker need not be hashable

    def is_valid(self, problem: PlanningProblem, path: PlannedPath) -> bool:
        """Whether nothing is wrong with a timed motion; see SolutionValidator."""
        return self._find_fault(problem, path) is None

    def fault(self, problem: PlanningProblem, path: PlannedPath) -> str:
        """Returns what is wrong with a timed motion, or nothing; see SolutionValidator."""
        describe = self._find_fault(problem, path)
        return describe() if describe else ""

    def _find_fault(self, problem: PlanningProblem, path: PlannedPath) -> Callable[[], str] | None:
        """Returns what describes the first fault of a motion; None where there is no fault."""
        assert path.trajectory is not None
        motion = path.trajectory
        key = b"".join(
            rows.tobytes() for rows in (motion.times, motion.positions, motion.velocities, motion.accelerations)
        )
        if key in self._passed and self._passed[key] is problem.checker:
            return None
        with problem.phases.measured(CHECK):
            describe = _first_fault(problem, path)
        if describe is None:
            self._passed[key] = problem.checker
        return describe


def _first_fault(problem: PlanningProblem, path: PlannedPath) -> Callable[[], str] | None:
    assert path.trajectory is not None
    disorder = _not_in_order(path)
    if disorder:
        return lambda: disorder
    curve = path.trajectory.curve(problem.settings.motion_step)
    chords = path.trajectory.chords(_sample_at(path.trajectory.positions, path, path.path_prefix))
    for line in (curve[_sample_at(curve, path, path.path_prefix) :], *chords):
        hit = _colliding_state(problem, line)
        if hit is not None:
            return partial(_describe_collision, problem, hit)
    return _find_violation(problem, curve[_sample_at(curve, path, path.unconstrained_prefix) :])


def _sample_at(samples: Array, path: PlannedPath, vertex: int) -> int:
    """Returns the number of the sample at a vertex of the path."""
    return int(np.argmin(np.linalg.norm(samples - path.vertices[vertex], axis=1))) if vertex else 0


def _not_in_order(path: PlannedPath) -> str:
    assert path.trajectory is not None
    times = path.trajectory.times
    if not np.isfinite(times).all() or not np.isfinite(path.trajectory.positions).all():
        return "a sample of the motion is not finite"
    bad = np.flatnonzero(np.diff(times) <= 0.0)
    return f"the time of sample {int(bad[0]) + 1} is not after the one before" if len(bad) else ""


def _colliding_state(problem: PlanningProblem, samples: Array) -> Array | None:
    samples = without_repeats(samples)  # long straight pieces are checked faster than many short ones
    for begin in range(0, max(1, len(samples) - 1), SAMPLES_AT_ONCE):
        _require_time(problem)
        hit = problem.motion.colliding_state(samples[begin : begin + SAMPLES_AT_ONCE + 1], problem.settings.finest_step)
        if hit is not None:
            return hit
    return None


def _describe_collision(problem: PlanningProblem, hit: Array) -> str:
    contacts = problem.checker.contacts(problem.motion.full_positions(hit), include_fixed=False)
    step = problem.settings.finest_step
    return f"{describe_contacts(contacts)}, at {describe_state(problem, hit)} (checked at {step} rad steps)"


def _require_time(problem: PlanningProblem) -> None:
    over = time.monotonic() - problem.end_s
    if problem.cancelled() or over > GRACE_S:
        raise PlanningError(
            ErrorCode.PREEMPTED if problem.cancelled() else ErrorCode.TIMED_OUT,
            "planning was cancelled during the check of the motion found"
            if problem.cancelled()
            else f"a motion was found, but its check was not done {over:.2f} s after the allowed "
            f"{problem.request.allowed_time_s:.2f} s; an unchecked motion is not returned: allow more time",
        )


def _find_violation(problem: PlanningProblem, samples: Array) -> Callable[[], str] | None:
    constraints = problem.constraints
    if constraints is None:
        return None
    states = problem.motion.full_path(samples)
    number = constraints.first_violated(states)
    if number < 0:
        return None
    return lambda: (
        f"sample {number} of {len(states)} violates a path constraint: {constraints.describe(states[number])}"
    )
