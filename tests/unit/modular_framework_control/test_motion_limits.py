# SPDX-License-Identifier: BSD-3-Clause
"""Limits of trajectories, and stops within them: curves against SciPy and the formulas."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from modular_framework_control.hardware_interface.joint_limit_parameters import JointLimits
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, Spline, Track, TrajectoryPoint
from modular_framework_control.trajectory.motion_limits import MotionLimits, limit_violations
from modular_framework_control.trajectory.stop_motion import FOLLOWING_LAG_S, MAX_COMMAND_AGE_S, StopMotion

FREE = MotionLimits.of([JointLimits()])
BOUND = MotionLimits.of([JointLimits(-2.0, 2.0, 3.0, max_acceleration=20.0)])
NOWHERE = np.zeros((2, 1))


def point(
    time_s: float, position: float, velocity: float | None = None, acceleration: float | None = None
) -> TrajectoryPoint:
    return TrajectoryPoint(
        time_s, (position,), () if velocity is None else (velocity,), () if acceleration is None else (acceleration,)
    )


def refusal(*points: TrajectoryPoint, limits: MotionLimits = BOUND, first: int = 0, here: float = 0.0) -> str:
    spline = Spline(JointTrajectory.of_points(("a",), points))
    return limit_violations(spline, ("a",), limits, np.array([here])).text(first, first + 1)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (
            (point(0.0, 0.0), point(1.0, 2.01)),
            "point 1: position of joint 'a' is 2.01; its limits are -2 to 2; give a pos",
        ),
        ((point(1.0, -2.5),), "point 0: position of joint 'a' is -2.5"),
        ((point(1.0, 0.0, -3.2),), "point 0: velocity of joint 'a' is -3.2; its limit is 3; give a lower velocity"),
        (
            (point(0.0, 0.0), point(0.1, 1.0)),
            "on the way to point 1, joint 'a' reaches the velocity 10; its limit is 3; "
            "give the point a later time_from_start",
        ),
        (
            (point(0.0, 0.0), point(1.0, 1.0), point(1.2, -1.0)),
            "on the way to point 2, joint 'a' reaches the velocity -10",
        ),
        ((point(0.0, 1.9, 2.0), point(1.0, 1.9, -2.0)), "on the way to point 1, joint 'a' reaches 2.4; its limits are"),
        ((point(0.0, -1e9, 1e6), point(1.0, 1e9, -1e6)), "point 0: position of joint 'a' is -1e+09"),
    ],
)
def test_what_is_beyond_a_limit_is_reported_with_point_joint_value_and_limit(
    points: tuple[TrajectoryPoint, ...], words: str
) -> None:
    assert words in refusal(*points)


@pytest.mark.parametrize(
    "points",
    [
        (point(0.0, 0.0), point(1.0, 2.0005)),
        (point(0.0, 0.0, 3.1), point(0.5, 1.5, 3.1)),
        (point(0.0, 0.0), point(0.5, 1.55)),
        (point(0.0, -2.0), point(4.0, 2.0)),
        (point(1.0, 0.0),),
    ],
)
def test_rounding_and_a_little_too_much_speed_are_allowed(points: tuple[TrajectoryPoint, ...]) -> None:
    assert refusal(*points) == ""


def test_where_no_limit_is_known_everything_finite_is_allowed() -> None:
    assert refusal(point(0.0, -1e9, 1e6), point(1e-3, 1e9, -1e6), limits=FREE) == ""


def test_points_that_are_left_out_do_not_count() -> None:
    points = (point(0.0, 9.0), point(0.1, 0.0), point(1.0, 0.5))
    assert refusal(*points) and refusal(*points, first=1) == ""


def test_of_very_many_faults_only_a_few_are_reported_and_the_rest_counted() -> None:
    text = refusal(*(point(0.001 * i, (-1.0) ** i * 5.0) for i in range(5000)))
    assert "point 7: position" in text and "point 8: position" not in text
    assert text.endswith("and 9991 more")  # 5000 positions, and the velocities of 4999 ways
    text = refusal(*(point(0.001 * i, (-1.0) ** i * 5.0) for i in range(5000)), first=4997)
    assert text.count("position of joint") == 3 and text.count("on the way") == 2 and "more" not in text


def test_a_joint_that_stands_outside_its_range_may_come_back_but_not_go_further() -> None:
    assert refusal(point(0.0, 2.4), point(1.0, 1.0), here=2.4) == ""
    assert "point 1: position of joint 'a' is 2.5; its limits are -2 to 2 (the joint is outside, at 2.4)" in refusal(
        point(0.0, 2.4), point(1.0, 2.5), here=2.4
    )


def test_a_joint_that_may_not_move_at_all_is_said_to_have_a_wrong_limit() -> None:
    still = MotionLimits.of([JointLimits(max_velocity=0.0)])
    assert "its limit is 0; this limit forbids any motion: correct it in robot_description" in refusal(
        point(0.0, 0.0), point(1.0, 0.5), limits=still
    )
    assert refusal(point(0.0, 0.5), point(1.0, 0.5), limits=still, here=0.5) == ""


def test_limits_hold_for_a_joint_whose_position_is_not_a_number() -> None:
    assert "position of joint 'a' is 2.5; its limits are -2 to 2" in refusal(point(1.0, 2.5), here=math.nan)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1.5, 1.5)] * 3), min_size=2, max_size=6), st.floats(0.3, 3.0))
def test_the_speed_between_points_is_that_of_scipys_curve(
    rows: list[tuple[float, float, float]], duration_s: float
) -> None:
    times_s = duration_s * np.arange(len(rows))
    curve = BPoly.from_derivatives(times_s, rows)
    fastest = float(np.abs(curve.derivative()(np.linspace(0.0, times_s[-1], 20001))).max())
    assume(fastest > 1e-3)
    points = [point(float(t), *row) for t, row in zip(times_s, rows, strict=True)]
    for share, refused in ((0.95 / 1.05, True), (1.01 / 1.05, False)):
        limits = MotionLimits.of([JointLimits(max_velocity=share * fastest + (0.0 if refused else 1e-9))])
        assert bool(refusal(*points, limits=limits)) == refused


def sampled(track: Track, begun_s: float) -> np.ndarray:
    return np.array([track.sample(t)[:, 0] for t in np.linspace(begun_s, track.end_s + 0.1, 2000)])


@settings(max_examples=100, deadline=None)
@given(
    position=st.floats(-2.0, 2.0),
    velocity=st.floats(-5.0, 5.0),
    desired=st.floats(-1000.0, 1000.0),
    desired_velocity=st.floats(-1e6, 1e6),
    duration_s=st.floats(0.01, 1.0),
    rate=st.floats(0.1, 1.0),
)
def test_a_ramp_begins_where_the_joint_is_brakes_as_it_may_and_stays_in_its_range(
    position: float, velocity: float, desired: float, desired_velocity: float, duration_s: float, rate: float
) -> None:
    actual = np.array([[position], [velocity]])
    track = StopMotion(duration_s, BOUND).tracks(np.array([[desired], [desired_velocity]]), actual, 5.0, rate)[0]
    rows = sampled(track, 5.0)
    way = np.abs(rows[:, 0] - position)
    under_way = min(abs(velocity), 3.0) * FOLLOWING_LAG_S + 3.0 * MAX_COMMAND_AGE_S
    assert abs(rows[0, 0] - position) <= under_way + 1e-9
    assert np.abs(rows[:, 1]).max() * rate <= 3.0 + 1e-9
    assert rows[:, 0].min() >= -2.0 - 1e-9 and rows[:, 0].max() <= 2.0 + 1e-9
    assert rows[-1, 1] == 0.0 and (np.diff(rows[:, 0]) * math.copysign(1.0, velocity) > -1e-9).all()
    braked_s = max(duration_s, 1.5 * min(abs(velocity), 3.0) / 20.0)
    assert way.max() <= under_way + 0.5 * min(abs(velocity), 3.0) * braked_s + 1e-9
    if abs(rows[-1, 0]) < 2.0 - 1e-9:  # the end of the range asks for more
        assert np.abs(rows[:, 2]).max() * rate**2 <= max(1.5 * min(abs(velocity), 3.0) / duration_s, 20.0) + 0.2


def test_a_ramp_that_may_not_brake_so_hard_takes_as_much_longer() -> None:
    track = StopMotion(0.01, BOUND).tracks(NOWHERE, np.array([[0.0], [2.0]]), 0.0, 1.0)[0]
    assert track.end_s == pytest.approx(1.5 * 2.0 / 20.0)
    assert np.abs(sampled(track, 0.0)[:, 2]).max() == pytest.approx(20.0, rel=1e-3)


@pytest.mark.parametrize("velocity", [2.0, -2.0, 1e-3])
def test_without_a_duration_a_joint_brakes_evenly_nearly_as_hard_as_it_may(velocity: float) -> None:
    track = StopMotion(0.0, BOUND).tracks(np.array([[0.0], [velocity]]), np.array([[0.0], [velocity]]), 3.0, 1.0)[0]
    moving = sampled(track, 3.0)[np.linspace(3.0, track.end_s + 0.1, 2000) < track.end_s]
    assert np.abs(moving[:, 2]) == pytest.approx(0.9 * 20.0, rel=1e-6)
    assert track.sample(4.0)[:, 0] == pytest.approx([velocity * abs(velocity) / (2.0 * 0.9 * 20.0), 0.0, 0.0])


@pytest.mark.parametrize(("duration_s", "rate", "braking"), [(0.0, 1.0, math.inf), (0.0, 0.0, 20.0), (0.5, 0.0, 20.0)])
def test_the_measured_position_is_held_while_the_robot_is_paused_and_where_no_deceleration_is_known(
    duration_s: float, rate: float, braking: float
) -> None:
    actual = np.array([[0.5], [2.0]])
    bound = replace(BOUND, max_decelerations=np.array([braking]))
    track = StopMotion(duration_s, bound).tracks(np.array([[1.5], [2.0]]), actual, 3.0, rate)[0]
    assert track.sample(4.0)[:, 0].tolist() == [0.5, 0.0, 0.0]
