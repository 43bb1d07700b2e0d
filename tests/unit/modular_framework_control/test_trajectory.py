# SPDX-License-Identifier: BSD-3-Clause
"""The curves between trajectory points, against SciPy, and what is wrong with a trajectory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly, CubicHermiteSpline

from modular_framework_control.trajectory.joint_trajectory import (
    InvalidTrajectoryError,
    JointTrajectory,
    Spline,
    Track,
    TrajectoryPoint,
    splice,
)
from modular_framework_control.trajectory.point_checks import check_points

RNG = np.random.default_rng(7)
NAMES = ("a", "b", "c")
REST = np.zeros((3, 3))


def random_states(points: int) -> tuple[np.ndarray, np.ndarray]:
    times = np.cumsum(RNG.uniform(0.05, 0.7, points))
    return times, RNG.uniform(-2.0, 2.0, (points, 3, 3))


def trajectory_of(times: np.ndarray, states: np.ndarray, rows: int) -> JointTrajectory:
    """Points giving the first `rows` of position, velocity and acceleration."""
    return JointTrajectory.of_points(
        NAMES,
        tuple(
            TrajectoryPoint(float(time_s), *(tuple(state[row]) for row in range(rows)))
            for time_s, state in zip(times, states, strict=True)
        ),
    )


def track_of(trajectory: JointTrajectory, start: np.ndarray) -> Track:
    return splice(Spline(trajectory), [0, 1, 2], origin_s=0.0, splice_s=0.0, state=start, continuous=[False] * 3)


def test_points_with_velocities_are_joined_by_the_cubic_of_scipy() -> None:
    times, states = random_states(8)
    track = track_of(trajectory_of(times, states, 2), REST)
    spline = CubicHermiteSpline(times, states[:, 0], states[:, 1])
    for time_s in np.linspace(times[0], times[-1], 200):
        sampled = track.sample(float(time_s))
        assert sampled[0] == pytest.approx(spline(time_s), abs=1e-9)
        assert sampled[1] == pytest.approx(spline(time_s, 1), abs=1e-8)


def test_points_with_accelerations_are_joined_by_the_quintic_of_scipy() -> None:
    times, states = random_states(8)
    track = track_of(trajectory_of(times, states, 3), REST)
    for joint in range(3):
        spline = BPoly.from_derivatives(times, states[:, :, joint])
        for time_s in np.linspace(times[0], times[-1], 200):
            sampled = track.sample(float(time_s))[:, joint]
            assert sampled[0] == pytest.approx(float(spline(time_s)), abs=1e-8)
            assert sampled[1] == pytest.approx(float(spline(time_s, 1)), abs=1e-7)
            assert sampled[2] == pytest.approx(float(spline(time_s, 2)), abs=1e-5)


def test_points_with_positions_only_are_joined_by_lines() -> None:
    times, states = random_states(6)
    track = track_of(trajectory_of(times, states, 1), REST)
    for time_s in np.linspace(0.0, times[-1], 100):
        expected = [np.interp(time_s, [0.0, *times], [0.0, *states[:, 0, joint]]) for joint in range(3)]
        assert track.sample(float(time_s))[0] == pytest.approx(expected, abs=1e-12)


def test_after_the_end_the_last_position_is_held_at_rest() -> None:
    times, states = random_states(4)
    sampled = track_of(trajectory_of(times, states, 3), REST).sample(float(times[-1]) + 1.0)
    assert sampled[0] == pytest.approx(states[-1, 0])
    assert not sampled[1:].any()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=9, max_size=9), st.floats(0.01, 1.9), st.integers(1, 3))
def test_a_splice_continues_the_motion_it_replaces(values: list[float], splice_s: float, rows: int) -> None:
    times, states = random_states(5)
    state = np.array(values).reshape(3, 3)
    origin_s = splice_s - 0.5 * float(times[0])
    track = splice(
        Spline(trajectory_of(times, states, rows)),
        [0, 1, 2],
        origin_s=origin_s,
        splice_s=splice_s,
        state=state,
        continuous=[False] * 3,
    )
    begun = track.sample(splice_s)
    for row in range(rows if rows > 1 else 1):
        assert begun[row] == pytest.approx(state[row], abs=1e-9)
    after_s = origin_s + 0.5 * float(times[1] + times[2])
    own = track_of(trajectory_of(times, states, rows), REST).sample(after_s - origin_s)
    assert track.sample(after_s)[0] == pytest.approx(own[0], abs=1e-7)


def test_a_trajectory_that_starts_where_the_joints_are_is_followed_as_sent() -> None:
    times, states = random_states(4)
    times -= times[0]
    track = track_of(trajectory_of(times, states, 3), states[0] * [[1.0], [1.0], [0.0]])
    spline = BPoly.from_derivatives(times, states[:, :, 0])
    time_s = 0.4 * float(times[1])
    assert track.sample(time_s)[0, 0] == pytest.approx(float(spline(time_s)), abs=1e-9)


def test_a_joint_without_end_goes_the_short_way() -> None:
    trajectory = JointTrajectory.of_points(("a",), (TrajectoryPoint(1.0, (0.1,)), TrajectoryPoint(2.0, (0.4,))))
    state = np.array([[4.0 * math.pi - 0.1], [0.0], [0.0]])
    track = splice(Spline(trajectory), [0], origin_s=0.0, splice_s=0.0, state=state, continuous=[True])
    assert track.sample(1.0)[0, 0] == pytest.approx(4.0 * math.pi + 0.1)
    assert track.sample(3.0)[0, 0] == pytest.approx(4.0 * math.pi + 0.4)


def test_a_track_without_some_joints_keeps_the_others() -> None:
    times, states = random_states(4)
    track = track_of(trajectory_of(times, states, 3), REST)
    rest = track.without([1])
    assert rest is not None and rest.joints == [0, 2]
    assert rest.sample(0.5) == pytest.approx(track.sample(0.5)[:, [0, 2]])
    assert track.without([0, 1, 2]) is None


def test_all_faults_of_a_trajectory_are_listed() -> None:
    trajectory = JointTrajectory.of_points(
        ("a", "b"),
        (
            TrajectoryPoint(-math.inf, (0.0, math.nan)),
            TrajectoryPoint(1.0, (0.0,)),
            TrajectoryPoint(1.0, (0.0, 0.0), (1.0,)),
            TrajectoryPoint(2.0, (), (), (1.0, -math.inf)),
        ),
        math.inf,
    )
    with pytest.raises(InvalidTrajectoryError) as caught:
        check_points(trajectory)
    for words in (
        "point 0: position of joint 'b' (index 1) is nan; expected a finite number",
        "point 0: time_from_start is -inf s; expected a time",
        "point 1: has 1 positions; expected 2",
        "point 2: has 1 velocities; expected 2 or none",
        "point 3: has 0 positions; expected 2",
        "point 2: time_from_start 1 s does not come after 1 s of point 1",
        "point 3: acceleration of joint 'b' (index 1) is -inf",
        "header stamp is inf",
    ):
        assert words in str(caught.value)


def test_of_very_many_faults_the_first_are_reported_and_the_others_counted() -> None:
    trajectory = JointTrajectory.of_points(("a",), tuple(TrajectoryPoint(i + 1.0, (math.nan,)) for i in range(1000)))
    with pytest.raises(InvalidTrajectoryError, match="point 7: .* and 992 more$"):
        check_points(trajectory)


def test_values_so_large_that_the_curve_would_not_be_finite_are_refused() -> None:
    with pytest.raises(InvalidTrajectoryError, match=r"position of joint 'a' \(index 0\) is 2e\+09; expected"):
        check_points(JointTrajectory.of_points(("a",), (TrajectoryPoint(1.0, (2e9,)),)))
    largest = Spline(
        JointTrajectory.of_points(
            ("a",), (TrajectoryPoint(0.0, (1e9,), (1e9,), (1e9,)), TrajectoryPoint(1e-9, (-1e9,), (-1e9,), (-1e9,)))
        )
    )
    assert np.isfinite(largest.coefficients).all()
