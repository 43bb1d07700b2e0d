# SPDX-License-Identifier: BSD-3-Clause
"""Speed profiles keep the closed form of a trapezoid and its limits; lines and arcs are lines and arcs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits, read_cartesian_limits
from modular_framework_planning.planners.pilz.pose_path import (
    LinePath,
    arc_around_centre,
    arc_through_interim,
    time_pose_path,
)
from modular_framework_planning.planners.pilz.velocity_profile import (
    MIN_GAP_S,
    ROUNDING_S,
    fastest_profile,
    sample_times,
)

LIMITS = CartesianLimits(1.0, 2.25, 5.0, 1.57)


def at(x: float, y: float, z: float, rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array([x, y, z]))


# rise = v / a, fall = v / d, cruise = s / v - (rise + fall) / 2; a triangle peaks at sqrt(2 s a d / (a + d))
@pytest.mark.parametrize(
    ("distance", "limits", "phases"),
    [
        (1.0, (0.5, 2.0, 1.0), (0.25, 1.625, 0.5)),
        (10.0, (2.0, 4.0, 4.0), (0.5, 4.5, 0.5)),
        (0.75, (9.0, 1.0, 2.0), (1.0, 0.0, 0.5)),
        (0.02, (1.0, 2.0, 2.0), (0.1, 0.0, 0.1)),
    ],
)
def test_phases_are_those_of_the_closed_form(
    distance: float, limits: tuple[float, float, float], phases: tuple[float, float, float]
) -> None:
    profile = fastest_profile(distance, *limits)
    assert (profile.rise_s, profile.cruise_s, profile.fall_s) == pytest.approx(phases, abs=1e-9)
    assert profile.duration_s == pytest.approx(sum(phases) + ROUNDING_S, abs=1e-9)
    middle = 0.5 * ROUNDING_S
    assert profile.sample(np.array([phases[0] + middle]))[0][0] == pytest.approx(
        0.5 * limits[1] * phases[0] ** 2, abs=limits[1] * ROUNDING_S**2
    ), "the end of the rise, a s^2 / 2"


@settings(max_examples=100, deadline=None)
@given(st.floats(1e-5, 50.0), st.floats(0.05, 5.0), st.floats(0.01, 20.0), st.floats(0.01, 20.0))
def test_profiles_go_the_distance_within_limits_and_rest_at_both_ends(
    distance: float, velocity: float, acceleration: float, deceleration: float
) -> None:
    profile = fastest_profile(distance, velocity, acceleration, deceleration)
    times = np.linspace(0.0, profile.duration_s, 2001)
    position, speed, change = profile.sample(times)
    assert position[0] == speed[0] == change[0] == 0.0
    assert position[-1] == pytest.approx(distance, rel=1e-9)
    assert abs(speed[-1]) < 1e-9 * max(1.0, velocity) and abs(change[-1]) < 1e-6 * max(1.0, deceleration)
    assert (np.diff(position) > -1e-12 * distance).all()
    assert speed.max() <= velocity * (1 + 1e-9) and speed.min() >= -1e-9 * velocity
    assert change.max() <= acceleration * (1 + 1e-6) and change.min() >= -deceleration * (1 + 1e-6)
    points = sample_times(profile.duration_s, profile.knots, 0.1)
    assert points[0] == 0.0 and points[-1] == pytest.approx(profile.duration_s, abs=1e-9)
    assert np.diff(points).min() >= 0.99e-4 and np.diff(points).max() <= 0.1 + MIN_GAP_S


def test_the_rotation_speeds_up_in_the_ratio_of_the_translation() -> None:
    motion = time_pose_path(LinePath.between(at(0, 0, 0), at(0, 0, 0, (0, 0, 1.0))), LIMITS, 1.0, 1.0)
    assert motion is not None
    turned = [float(np.linalg.norm(pin.log3(motion.pose(time_s).rotation))) for time_s in (0.1, 0.2, 0.3)]
    second = (turned[2] - 2 * turned[1] + turned[0]) / 0.1**2
    assert second == pytest.approx(2.25 / 1.0 * 1.57, rel=1e-6)


def test_translation_and_rotation_arrive_together() -> None:
    motion = time_pose_path(LinePath.between(at(0, 0, 0), at(0.3, 0, 0, (0, 0, 1.2))), LIMITS, 0.5, 0.5)
    assert motion is not None
    for time_s in np.linspace(0.0, motion.duration_s, 17):
        pose = motion.pose(float(time_s))
        assert pose.translation[0] / 0.3 == pytest.approx(np.linalg.norm(pin.log3(pose.rotation)) / 1.2, abs=1e-9)
    assert time_pose_path(LinePath.between(at(0, 0, 0), at(0, 0, 0)), LIMITS, 1.0, 1.0) is None


def test_a_line_is_straight_and_turns_about_one_axis() -> None:
    start, end = at(0.1, -0.2, 0.3, (0.3, 0.2, 0.1)), at(0.5, 0.3, 0.2, (-1.0, 0.4, 2.0))
    path = LinePath.between(start, end)
    rotation = pin.log3(start.rotation.T @ end.rotation)
    for share in np.linspace(0.0, 1.0, 11):
        pose = path.pose(float(share))
        assert np.allclose(pose.translation, (1 - share) * start.translation + share * end.translation, atol=1e-12)
        assert np.allclose(pin.log3(start.rotation.T @ pose.rotation), share * rotation, atol=1e-9)


def test_a_centre_gives_the_shorter_arc() -> None:
    path = arc_around_centre(at(1, 0, 0), at(0, -1, 0), np.zeros(3))
    assert path.angle == pytest.approx(np.pi / 2) and path.translation_length == pytest.approx(np.pi / 2)
    assert np.allclose(path.pose(0.5).translation, [np.sqrt(0.5), -np.sqrt(0.5), 0.0])
    assert np.allclose(path.pose(1.0).translation, [0, -1, 0])


@pytest.mark.parametrize(
    ("interim", "angle"),
    [((np.sqrt(0.5), np.sqrt(0.5)), np.pi / 2), ((-1.0, 0.0), 3 * np.pi / 2), ((0.0, -1.0), 3 * np.pi / 2)],
)
def test_an_interim_point_lies_on_the_arc_whichever_way_round(interim: tuple[float, float], angle: float) -> None:
    point = np.array([*interim, 0.0])
    path = arc_through_interim(at(1, 0, 0), at(0, 1, 0), point)
    assert path.angle == pytest.approx(angle)
    assert np.allclose(path.centre, 0.0, atol=1e-12)
    ways = np.array([path.pose(float(share)).translation for share in np.linspace(0.0, 1.0, 3601)])
    assert np.allclose(np.linalg.norm(ways, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(ways - point, axis=1).min() < 2e-3
    assert np.allclose(ways[-1], [0, 1, 0], atol=1e-12)


def test_an_interim_point_can_give_a_half_circle() -> None:
    path = arc_through_interim(at(1, 0, 0), at(-1, 0, 0), np.array([0.0, 0.0, 1.0]))
    assert path.angle == pytest.approx(np.pi)
    assert np.allclose(path.pose(0.5).translation, [0, 0, 1])


def test_a_centre_that_is_a_little_off_still_leads_exactly_to_the_goal() -> None:
    path = arc_around_centre(at(1, 0, 0), at(0, 1.005, 0), np.zeros(3))
    assert np.allclose(path.pose(0.0).translation, [1, 0, 0]) and np.allclose(path.pose(1.0).translation, [0, 1.005, 0])


@pytest.mark.parametrize(
    ("build", "goal", "point", "text"),
    [
        (arc_around_centre, (-1, 0, 0), (0, 0, 0), "for a half circle"),
        (arc_around_centre, (1, 0, 0), (0, 0, 0), "for a half circle"),
        (arc_around_centre, (0, 1.02, 0), (0, 0, 0), "1.0000 m from the centre and goal 1.0200 m"),
        (arc_around_centre, (0, 1, 0), (1, 0, 0), "0.000000 m from start or goal"),
        (arc_through_interim, (1, 0, 0), (0, 1, 0), "two arcs"),
        (arc_through_interim, (3, 0, 0), (2, 0, 0), "lie on one line"),
        (arc_through_interim, (0, 1, 0), (1, 0, 0), "coincide"),
    ],
)
def test_points_that_give_no_circle_are_refused(
    build: object, goal: tuple[float, ...], point: tuple[float, ...], text: str
) -> None:
    with pytest.raises(PlanningError) as caught:
        build(at(1, 0, 0), at(*goal), np.array(point, dtype=float))
    assert caught.value.code == ErrorCode.INVALID_MOTION_PLAN and text in caught.value.reason


def test_limits_that_cannot_be_are_all_named() -> None:
    good = {"max_trans_vel": 1, "max_trans_acc": 2.25, "max_trans_dec": -5, "max_rot_vel": 1.57}
    assert read_cartesian_limits(good) == LIMITS
    with pytest.raises(ModelError) as caught:
        read_cartesian_limits({"max_trans_vel": 0.0, "max_trans_acc": float("nan"), "max_trans_dec": 5.0})
    for text in (
        "max_trans_vel is 0.0",
        "max_trans_acc is nan",
        "max_trans_dec is 5.0; it must be a number below 0",
        "max_rot_vel is missing",
    ):
        assert text in caught.value.reason
