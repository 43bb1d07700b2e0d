# SPDX-License-Identifier: BSD-3-Clause
"""Timed motions keep the limits along the whole curve a controller runs, follow their path and are nearly fastest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from blended_path_reference import BlendedPath

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.planning_interface.phase_times import PhaseTimes
from modular_framework_planning.planning_interface.planner_interface import PlannedPath
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.planning_pipeline.trajectory_validator import TrajectoryValidator
from modular_framework_planning.trajectory_processing.compiled_curves import quintic_coefficients
from modular_framework_planning.trajectory_processing.compiled_timing import SAMPLES_PER_SEGMENT, max_limit_fractions
from modular_framework_planning.trajectory_processing.time_parameterization import WINDOW_S, parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

VELOCITY = np.array([3.15, 3.15, 3.15, 3.2, 3.2, 3.2])
ACCELERATION = np.array([5.0, 5.0, 5.0, 8.0, 8.0, 8.0])
JOINTS = tuple("abcdef")


def random_polyline(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, and corner distances of which a fifth are 0."""
    vertices = np.cumsum(rng.uniform(-1, 1, (rng.integers(2, 9), 6)) * rng.choice([0.01, 0.1, 1.0]), axis=0)
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    blends = rng.uniform(0.02, 0.45, max(0, len(vertices) - 2)) * np.minimum(lengths[:-1], lengths[1:])
    return vertices, blends * (rng.random(len(blends)) < 0.8)


def shares(motion: Trajectory, velocity: np.ndarray, acceleration: np.ndarray) -> tuple[float, float]:
    """Largest share of the limits at 1 ms samples of the controller's curve."""
    _, velocities, accelerations, _ = motion.sample(motion.sample_times(0.001))
    return float((np.abs(velocities) / velocity).max()), float((np.abs(accelerations) / acceleration).max())


def test_limits_hold_at_every_millisecond_of_the_controllers_curve() -> None:
    rng = np.random.default_rng(1)
    for _ in range(150):
        vertices, blends = random_polyline(rng)
        velocity, acceleration = VELOCITY * rng.choice([0.1, 1.0]), ACCELERATION * rng.choice([0.01, 0.5, 1.0])
        motion = parameterize(JOINTS, vertices, blends, velocity, acceleration)
        assert motion.times[0] == 0.0 and np.diff(motion.times).min() > 1e-3
        assert max(shares(motion, velocity, acceleration)) <= 1.0
        assert np.array_equal(motion.positions[[0, -1]], vertices[[0, -1]])
        for column in (motion.velocities, motion.accelerations):
            assert np.allclose(column[[0, -1]], 0.0, atol=1e-9)
        assert np.array_equal(motion.times, np.round(motion.times, 9)), "messages carry whole nanoseconds"


def test_curve_is_the_one_a_joint_trajectory_controller_runs() -> None:
    control = pytest.importorskip(
        "modular_framework_control.trajectory.joint_trajectory", reason="source the workspace"
    )
    rng = np.random.default_rng(2)
    vertices, blends = random_polyline(rng)
    motion = parameterize(JOINTS, vertices, blends, VELOCITY, ACCELERATION)
    points = tuple(
        control.TrajectoryPoint(
            *(tuple(np.atleast_1d(item).tolist()) if number else float(item) for number, item in enumerate(row))
        )
        for row in zip(motion.times, motion.positions, motion.velocities, motion.accelerations, strict=True)
    )
    spline = control.Spline(control.JointTrajectory.of_points(JOINTS, points))
    assert np.allclose(motion.coefficients, spline.coefficients, rtol=1e-6, atol=1e-6)


def distance_to_path(path: BlendedPath, points: np.ndarray) -> float:
    """Largest distance of some points from a path [rad]."""
    dense = path.evaluate(np.linspace(0.0, path.length, int(path.length / 2e-4) + 2))
    return max(float(np.abs(dense - point).max(axis=1).min()) for point in points)


def test_motion_stays_on_its_path_but_for_the_averaging_of_curves() -> None:
    rng = np.random.default_rng(3)
    vertices = np.cumsum(rng.uniform(-1, 1, (5, 6)), axis=0)
    blends = np.full(3, 0.2)
    motion = parameterize(JOINTS, vertices, blends, VELOCITY, ACCELERATION)
    allowed = ACCELERATION.max() * WINDOW_S**2 / 24 + 3e-4
    assert distance_to_path(BlendedPath(vertices, blends), motion.sample(motion.sample_times(0.005))[0]) < allowed


def fastest_duration(path: BlendedPath, velocity: np.ndarray, acceleration: np.ndarray) -> float:
    """Duration found by the public TOPP-RA library on a fine grid."""
    toppra = pytest.importorskip("toppra")
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    class Path(AbstractGeometricPath):
        dof, path_interval = 6, np.array([0.0, path.length])

        def __call__(self, positions: np.ndarray, order: int = 0) -> np.ndarray:
            values = path.evaluate(np.atleast_1d(positions), order)
            return values if np.ndim(positions) else values[0]

    grid = np.unique(
        np.concatenate([path.breaks, path.breaks[1:-1] + 1e-6, np.linspace(0.0, path.length, int(path.length / 0.004))])
    )
    limits = [
        JointVelocityConstraint(np.column_stack([-velocity, velocity])),
        JointAccelerationConstraint(
            np.column_stack([-acceleration, acceleration]), discretization_scheme=DiscretizationType.Collocation
        ),
    ]
    speeds = toppra.algorithm.TOPPRA(limits, Path(), gridpoints=grid, solver_wrapper="seidel").compute_parameterization(
        0.0, 0.0
    )[1]
    return float((2.0 * np.diff(grid) / (speeds[:-1] + speeds[1:])).sum())


def test_motion_is_as_fast_as_the_public_library_finds_but_for_the_window() -> None:
    rng = np.random.default_rng(4)
    for _ in range(6):
        vertices = np.cumsum(rng.uniform(-1, 1, (5, 6)), axis=0)
        blends = np.full(3, 0.2)
        motion = parameterize(JOINTS, vertices, blends, VELOCITY, ACCELERATION)
        fastest = fastest_duration(BlendedPath(vertices, blends), VELOCITY, ACCELERATION)
        assert 0.99 * fastest < motion.duration_s < 1.03 * fastest + WINDOW_S


def test_one_vertex_is_a_motion_of_one_point() -> None:
    motion = parameterize(JOINTS, np.ones((1, 6)), np.zeros(0), VELOCITY, ACCELERATION)
    assert motion.duration_s == 0.0 and np.array_equal(motion.positions, np.ones((1, 6)))
    assert np.array_equal(motion.sample(np.zeros(2))[0], np.ones((2, 6)))


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_limits_that_are_no_limits_are_refused(bad: float) -> None:
    with pytest.raises(PlanningError, match="finite and above 0"):
        parameterize(JOINTS, np.zeros((2, 6)), np.zeros(0), VELOCITY * bad, ACCELERATION)


def test_dense_curve_has_no_gap_wider_than_asked() -> None:
    rng = np.random.default_rng(5)
    vertices, blends = random_polyline(rng)
    motion = parameterize(JOINTS, vertices, blends, VELOCITY, ACCELERATION)
    curve = motion.curve(0.004)
    assert np.abs(np.diff(curve, axis=0)).max() < 1.2 * 0.004
    assert np.array_equal(curve[0], motion.positions[0]) and np.array_equal(curve[-1], motion.positions[-1])


def test_chords_are_found_where_the_curve_leaves_them_and_nowhere_else() -> None:
    straight = parameterize(JOINTS[:2], np.array([[0.0, 0.0], [1.0, 0.5]]), np.zeros(0), VELOCITY[:2], ACCELERATION[:2])
    assert straight.chords() == []
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    motion = parameterize(JOINTS[:2], corner, np.array([0.3]), VELOCITY[:2], ACCELERATION[:2])
    (chord,) = motion.chords()
    assert (np.abs(chord - [1.0, 0.0]).max(axis=1) < 0.35).all() and len(chord) > 3
    rows = [int(np.flatnonzero((motion.positions == row).all(axis=1))[0]) for row in chord]
    assert rows == list(range(rows[0], rows[0] + len(rows))), "points in a row"
    assert len(motion.chords(first=rows[2])[0]) == len(chord) - 2


def checked_problem(colliding_state: Callable[[np.ndarray, float], np.ndarray | None]) -> SimpleNamespace:
    class Checker:
        __hash__ = None  # type: ignore[assignment]  # nothing asks a checker of one's own to be hashable

        def contacts(self, _: np.ndarray, include_fixed: bool) -> list[object]:
            return []

    return SimpleNamespace(
        settings=PipelineSettings(),
        constraints=None,
        phases=PhaseTimes(),
        checker=Checker(),
        end_s=np.inf,
        cancelled=lambda: False,
        group=SimpleNamespace(joints=("a",)),
        motion=SimpleNamespace(colliding_state=colliding_state, full_positions=lambda values: values),
    )


def test_the_validator_checks_every_motion_once() -> None:
    looked: list[int] = []
    problem = checked_problem(lambda line, step: looked.append(len(line)))
    motion = parameterize(("a",), np.array([[0.0], [1.0]]), np.zeros(0), VELOCITY[:1], ACCELERATION[:1])
    others = (motion, replace(motion, times=2.0 * motion.times), replace(motion, accelerations=motion.velocities))
    check = TrajectoryValidator()
    for number in (1, 2):
        for other in others:
            assert check.fault(problem, PlannedPath(other.positions, other)) == ""
        if number == 1:
            seen = len(looked)
            assert seen >= len(others), "points and speeds alone do not make a curve"
    assert len(looked) == seen
    problem.checker = checked_problem(problem.motion.colliding_state).checker
    check.fault(problem, PlannedPath(motion.positions, motion))
    assert len(looked) > seen, "another world is another question"


def test_the_validator_sees_a_contact_a_twentieth_of_a_milliradian_long() -> None:
    def colliding_state(line: np.ndarray, step: float) -> np.ndarray | None:
        for start, end in zip(line[:-1], line[1:], strict=True):
            count = int(np.ceil(np.abs(end - start).max() / step))
            for share in np.linspace(0.0, 1.0, count + 1):
                values = start + share * (end - start)
                if 0.5 < values[0] < 0.50005:
                    return values
        return None

    motion = parameterize(("a",), np.array([[0.0], [1.0]]), np.zeros(0), VELOCITY[:1], ACCELERATION[:1])
    problem = checked_problem(colliding_state)
    fault = TrajectoryValidator().fault(problem, PlannedPath(motion.positions, motion))
    assert f"{problem.settings.finest_step} rad steps" in fault
    problem.motion.colliding_state = lambda line, step: None
    assert TrajectoryValidator().fault(problem, PlannedPath(motion.positions, motion)) == ""


def quintic(start: tuple[float, ...], end: tuple[float, ...], span: float) -> np.polynomial.Polynomial:
    """The quintic with given position, velocity and acceleration at both ends, by its six linear equations."""
    powers = np.arange(6)
    rows, values = [], []
    for time, state in ((0.0, start), (span, end)):
        for order, value in enumerate(state):
            factor = np.prod([powers - number for number in range(order)], axis=0) if order else np.ones(6)
            rows.append(np.where(powers >= order, factor * time ** np.maximum(powers - order, 0), 0.0))
            values.append(value)
    return np.polynomial.Polynomial(np.linalg.solve(np.array(rows), np.array(values)))


def test_the_curve_and_its_derivatives_are_those_of_the_quintics_through_the_points() -> None:
    rng = np.random.default_rng(12)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 0.8, 5))])
    motion = Trajectory(("a", "b"), times, *rng.uniform(-1.0, 1.0, (3, 6, 2)))
    wanted = np.concatenate([rng.uniform(0.0, times[-1], 40), times])
    values = motion.sample(wanted)
    assert np.array_equal(motion.positions_at(wanted), values[0])
    for joint in range(2):
        states = [
            tuple(float(item[row, joint]) for item in (motion.positions, motion.velocities, motion.accelerations))
            for row in range(6)
        ]
        pieces = [quintic(states[row], states[row + 1], times[row + 1] - times[row]) for row in range(5)]
        for number, time in enumerate(wanted):
            row = min(int(np.searchsorted(times, time, side="right")) - 1, 4)
            for order in range(4):
                expected = pieces[row].deriv(order)(time - times[row]) if order else pieces[row](time - times[row])
                assert values[order][number, joint] == pytest.approx(expected, abs=1e-7, rel=1e-7)
    for before in (-1.0, times[-1] + 1.0):
        ends = motion.sample(np.array([before]))[0][0]
        assert np.allclose(ends, motion.positions[0 if before < 0.0 else -1])


def test_the_largest_shares_are_those_of_all_samples() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.004, 0.5, 30))])
        values = rng.normal(size=(31, 5)), rng.normal(size=(31, 5)), rng.normal(size=(31, 5))
        coefficients = quintic_coefficients(times, *values)
        limits = rng.uniform(0.5, 2.0, 5), rng.uniform(0.5, 2.0, 5)
        found = max_limit_fractions(times, coefficients, *limits, SAMPLES_PER_SEGMENT)
        seconds = np.diff(times)[:, None] * np.arange(SAMPLES_PER_SEGMENT + 1) / SAMPLES_PER_SEGMENT
        for share, limit, order in zip(found, limits, (1, 2), strict=True):
            curves = [
                np.polynomial.Polynomial(coefficients[i, :, j]).deriv(order)(seconds[i]) / limit[j]
                for i in range(30)
                for j in range(5)
            ]
            assert share == pytest.approx(np.abs(curves).max(), rel=1e-12)
