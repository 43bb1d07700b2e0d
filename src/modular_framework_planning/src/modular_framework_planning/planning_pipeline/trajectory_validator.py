# SPDX-License-Identifier: BSD-3-Clause
"""Final validation of every motion, independent of the planner and the request adapters."""

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

SAMPLES_PER_TIME_CHECK = 200
GRACE_S = 0.2  # time that a running validation may exceed the deadline


class TrajectoryValidator:
    """Validates the curve of a trajectory and the straight lines between its points; valid motions are cached."""

    def __init__(self) -> None:
        self._passed: dict[bytes, CollisionChecker] = {}  # keyed by motion; a checker may be unhashable

    def is_valid(self, problem: PlanningProblem, path: PlannedPath) -> bool:
        """Checks that the trajectory of a path is valid; see SolutionValidator."""
        return self._find_fault(problem, path) is None

    def fault(self, problem: PlanningProblem, path: PlannedPath) -> str:
        """Returns the fault of the trajectory of a path, empty if it is valid; see SolutionValidator."""
        describe = self._find_fault(problem, path)
        return describe() if describe else ""

    def _find_fault(self, problem: PlanningProblem, path: PlannedPath) -> Callable[[], str] | None:
        """Returns a function that describes the first fault of a motion, or None."""
        assert path.trajectory is not None
        motion = path.trajectory
        key = b"".join(
            rows.tobytes() for rows in (motion.times, motion.positions, motion.velocities, motion.accelerations)
        )
        if key in self._passed and self._passed[key] is problem.checker:
            return None
        with problem.phases.measure(CHECK):
            describe = _first_fault(problem, path)
        if describe is None:
            self._passed[key] = problem.checker
        return describe


def _first_fault(problem: PlanningProblem, path: PlannedPath) -> Callable[[], str] | None:
    assert path.trajectory is not None
    order_fault = _order_fault(path)
    if order_fault:
        return lambda: order_fault
    curve = path.trajectory.curve(problem.settings.motion_step)
    chords = path.trajectory.chords(_sample_index(path.trajectory.positions, path, path.path_prefix))
    for line in (curve[_sample_index(curve, path, path.path_prefix) :], *chords):
        colliding_values = _colliding_state(problem, line)
        if colliding_values is not None:
            return partial(_describe_collision, problem, colliding_values)
    return _find_violation(problem, curve[_sample_index(curve, path, path.unconstrained_prefix) :])


def _sample_index(samples: Array, path: PlannedPath, vertex: int) -> int:
    """Returns the index of the sample nearest to a vertex of the path."""
    return int(np.argmin(np.linalg.norm(samples - path.vertices[vertex], axis=1))) if vertex else 0


def _order_fault(path: PlannedPath) -> str:
    assert path.trajectory is not None
    times = path.trajectory.times
    if not np.isfinite(times).all() or not np.isfinite(path.trajectory.positions).all():
        return "a sample of the motion is not finite"
    late = np.flatnonzero(np.diff(times) <= 0.0)
    return f"the time of sample {int(late[0]) + 1} is not after the time of the previous sample" if len(late) else ""


def _colliding_state(problem: PlanningProblem, samples: Array) -> Array | None:
    samples = without_repeats(samples)  # a long straight piece is checked faster than many short pieces
    for first in range(0, max(1, len(samples) - 1), SAMPLES_PER_TIME_CHECK):
        _require_time(problem)
        colliding_values = problem.motion.colliding_state(
            samples[first : first + SAMPLES_PER_TIME_CHECK + 1], problem.settings.finest_step
        )
        if colliding_values is not None:
            return colliding_values
    return None


def _describe_collision(problem: PlanningProblem, colliding_values: Array) -> str:
    contacts = problem.checker.contacts(problem.motion.full_positions(colliding_values), include_fixed=False)
    step = problem.settings.finest_step
    return (
        f"{describe_contacts(contacts)}, at {describe_state(problem, colliding_values)} (checked at {step} rad steps)"
    )


def _require_time(problem: PlanningProblem) -> None:
    overrun_s = time.monotonic() - problem.end_s
    if problem.cancelled() or overrun_s > GRACE_S:
        raise PlanningError(
            ErrorCode.PREEMPTED if problem.cancelled() else ErrorCode.TIMED_OUT,
            "planning was cancelled during the validation of a motion"
            if problem.cancelled()
            else f"a motion was found, but its validation had not finished {overrun_s:.2f} s after the allowed "
            f"{problem.request.allowed_time_s:.2f} s; an unchecked motion is not returned: allow more time",
        )


def _find_violation(problem: PlanningProblem, samples: Array) -> Callable[[], str] | None:
    constraints = problem.constraints
    if constraints is None:
        return None
    states = problem.motion.full_path(samples)
    index = constraints.first_violated(states)
    if index < 0:
        return None
    return lambda: f"sample {index} of {len(states)} violates a path constraint: {constraints.describe(states[index])}"
