# SPDX-License-Identifier: BSD-3-Clause
"""Odometry, limits of velocities and wheel geometry of mobile bases, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from modular_framework_control.mobile_base.planar_odometry import PlanarOdometry, arc
from modular_framework_control.mobile_base.speed_limiter import SpeedLimiter, read_speed_limiter
from modular_framework_control.mobile_base.wheel_geometry import WheelGeometry
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError

NUMBERS = st.floats(-3.0, 3.0)


@given(NUMBERS, NUMBERS, st.one_of(NUMBERS, st.floats(-2e-4, 2e-4)))
def test_an_arc_is_the_exponential_of_its_twist(forward: float, sideways: float, turn: float) -> None:
    twist = np.array([[0.0, -turn, forward], [turn, 0.0, sideways], [0.0, 0.0, 0.0]])
    assert arc(forward, sideways, turn) == pytest.approx(expm(twist)[:2, 2], abs=1e-12)


@pytest.mark.parametrize("steps", [4, 360])
def test_a_full_circle_ends_where_it_began_however_coarse_the_steps(steps: int) -> None:
    odometry = PlanarOdometry(10)
    odometry.start(0.0)
    radius = 0.7
    for step in range(1, steps + 1):
        turn = 2.0 * math.pi / steps
        odometry.move(radius * turn, turn, 0.01 * step)
        angle = turn * step
        assert (odometry.x, odometry.y) == pytest.approx(
            (radius * math.sin(angle), radius * (1.0 - math.cos(angle))), abs=1e-12
        )
    assert odometry.heading == pytest.approx(2.0 * math.pi)


def test_estimated_velocities_are_the_mean_of_the_last_cycles() -> None:
    odometry = PlanarOdometry(3)
    odometry.start(0.0)
    for cycle, forward in enumerate((0.1, 0.2, 0.3, 0.4), start=1):
        odometry.move(forward, -forward, 0.1 * cycle)
    assert (odometry.linear, odometry.angular) == pytest.approx((3.0, -3.0))


def test_a_cycle_without_time_moves_the_base_and_says_nothing_of_its_velocity() -> None:
    odometry = PlanarOdometry(3)
    odometry.start(1.0)
    odometry.move(0.5, 0.0, 1.0)
    assert (odometry.x, odometry.linear) == (0.5, 0.0)


def test_a_base_that_drifts_sideways_while_it_turns_goes_round_a_centre_ahead_or_behind() -> None:
    odometry = PlanarOdometry(1)
    odometry.start(0.0)
    for cycle in range(1, 101):
        odometry.move_at(0.0, 0.5, 1.0, 0.01 * cycle)
    assert (odometry.x, odometry.y) == pytest.approx((0.5 * (math.cos(1.0) - 1.0), 0.5 * math.sin(1.0)))


# ---- limits ----


def ramp(limiter: SpeedLimiter, wanted: float, cycles: int, period_s: float = 0.01) -> list[float]:
    speeds = [0.0, 0.0]
    for _ in range(cycles):
        speeds.append(limiter.limit(wanted, speeds[-1], speeds[-2], period_s))
    return speeds[1:]


def test_a_base_speeds_up_no_faster_than_its_acceleration_and_no_further_than_its_velocity() -> None:
    speeds = ramp(SpeedLimiter((-0.5, 1.0), (-0.5, 1.0)), 10.0, 200)
    assert speeds[50] == pytest.approx(0.5)
    assert speeds[-1] == 1.0
    assert ramp(SpeedLimiter((-0.5, 1.0), (-0.5, 1.0)), -10.0, 300)[-1] == -0.5


@given(st.floats(-10.0, 10.0), st.floats(0.5, 20.0), st.floats(0.1, 5.0))
def test_velocity_acceleration_and_jerk_of_a_start_keep_to_their_limits(
    wanted: float, jerk: float, acceleration: float
) -> None:
    speeds = np.array(ramp(SpeedLimiter((-2.0, 2.0), (-acceleration, acceleration), (-jerk, jerk)), wanted, 60))
    changes = np.diff(speeds) / 0.01
    assert np.all(np.abs(speeds) <= 2.0 + 1e-9)
    assert np.all(np.abs(changes) <= acceleration + 1e-6)
    before_limit = np.abs(speeds[1:]) < min(2.0, abs(wanted)) - 1e-9  # what cuts a ramp off is no jerk of it
    jerks = np.diff(np.concatenate([[0.0], changes])) / 0.01
    assert np.all(np.abs(jerks[before_limit & (np.abs(changes) < acceleration - 1e-9)]) <= 2.0 * jerk + 1e-3)


def test_a_start_with_limited_jerk_is_that_of_the_public_test() -> None:
    limiter = SpeedLimiter((-0.5, 1.0), (-0.5, 1.0), (-5.0, 5.0))
    speeds = ramp(limiter, 10.0, 50)
    assert speeds[10] == pytest.approx(0.5 * 10.0 * 0.1**2, rel=0.11), "twice the jerk that is given"
    assert np.mean(speeds[-10:]) == pytest.approx(0.37, abs=0.1), "the odometry of the public test after half a second"


def test_without_limits_or_time_commands_pass_or_stand() -> None:
    assert SpeedLimiter().limit(7.0, 1.0, 2.0, 0.0) == 7.0
    assert SpeedLimiter(acceleration=(-1.0, 1.0), jerk=(-1.0, 1.0)).limit(7.0, 1.0, 1.0, 0.0) == 1.0


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"has_velocity_limits": True}, "/x/max_velocity is not set although has_velocity_limits is true"),
        ({"has_jerk_limits": True, "max_jerk": -2.0}, "must be at least 0"),
        ({"has_acceleration_limits": True, "max_acceleration": 1.0, "min_acceleration": 0.5}, "base can stop"),
        ({"has_velocity_limits": "yes"}, "expected true or false"),
    ],
)
def test_limits_that_make_no_sense_are_refused(parameters: dict[str, Any], fault: str) -> None:
    with pytest.raises(ParameterError, match=fault):
        read_speed_limiter(MappingNodeHandle(parameters, "/x"))


def test_the_smallest_value_is_minus_the_largest_unless_it_is_given() -> None:
    limiter = read_speed_limiter(
        MappingNodeHandle(
            {
                "has_velocity_limits": True,
                "max_velocity": 2.0,
                "has_jerk_limits": True,
                "max_jerk": 3.0,
                "min_jerk": -1.0,
                "max_acceleration": 9.0,
            }
        )
    )
    assert limiter == SpeedLimiter(velocity=(-2.0, 2.0), jerk=(-1.0, 3.0))


# ---- geometry ----

URDF = """<robot name="r"><link name="base"/><link name="axle"/>
<link name="wheel"><collision><geometry><cylinder radius="0.11" length="0.1"/></geometry></collision></link>
<link name="ball"><collision><geometry><sphere radius="0.2"/></geometry></collision></link>
<link name="cube"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="left" type="continuous"><parent link="base"/><child link="wheel"/><origin xyz="0.1 0.3 0"/></joint>
<joint name="turned" type="fixed"><parent link="base"/><child link="axle"/>
<origin xyz="0.1 0 0.5" rpy="0 0 1.5707963267948966"/></joint>
<joint name="right" type="continuous"><parent link="axle"/><child link="ball"/><origin xyz="-0.2 0 -0.5"/></joint>
<joint name="square" type="continuous"><parent link="base"/><child link="cube"/>{origin}</joint></robot>"""


def geometry(origin: str = "", description: Any = None) -> WheelGeometry:
    text = URDF.format(origin=origin) if description is None else description
    return WheelGeometry(MappingNodeHandle({"robot_description": text} if text else {}), "wheel_radius")


def test_distances_hold_also_between_wheels_of_different_parents() -> None:
    assert geometry().between("left", "right") == pytest.approx([0.0, -0.5, 0.0])
    assert geometry().between("right", "left") == pytest.approx([0.5, 0.0, 0.0])  # in the frame of the turned axle
    assert geometry().distance("left", "right") == pytest.approx(0.5)


def test_the_radius_is_that_of_the_cylinder_or_sphere_of_the_wheel() -> None:
    assert geometry().radius("left") == 0.11
    assert geometry().radius("right") == 0.2


@pytest.mark.parametrize(
    ("ask", "fault"),
    [
        (lambda: geometry().radius("square"), "wheel link 'cube' is <box>; expected <cylinder> or <sphere>"),
        (lambda: geometry().radius("none"), "unknown joint 'none'; joints: left, right, square, turned"),
        (lambda: geometry('<origin xyz="1 2"/>').distance("left", "square"), "<origin xyz> of joint 'square' is '1 2'"),
        (lambda: geometry(description="<robot"), "not well-formed XML"),
        (lambda: geometry(description=""), "is not set, but needed for wheel_radius"),
        (
            lambda: geometry(
                description='<robot name="r"><joint name="a"><parent link="x"/><child link="x"/></joint></robot>'
            ).distance("a", "a"),
            "joint 'a' closes a loop of links: x -> x",
        ),
        (
            lambda: geometry(
                description='<robot name="r"><link name="l"><collision><geometry><sphere radius="-1"/></geometry>'
                '</collision></link><joint name="a"><child link="l"/></joint></robot>'
            ).radius("a"),
            "is '-1'; expected a number above 0",
        ),
    ],
)
def test_a_description_that_does_not_answer_is_an_error_that_says_why(ask: Any, fault: str) -> None:
    with pytest.raises(ParameterError, match=fault):
        ask()
