# SPDX-License-Identifier: BSD-3-Clause
"""The check of commands before they are sent to the arm."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_control.hardware_interface.joint_limits import JointLimits, SoftJointLimits
from modular_framework_control.trajectory.motion_limits import GOAL_TOLERANCE
from modular_framework_drivers.ur.arm_parameters import read_checked_joints
from modular_framework_drivers.ur.command_check import CheckedJoint, CommandCheck
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError

NAMES = ("shoulder", "elbow")
LIMITS = JointLimits(-2.0, 2.0, max_velocity=3.0, max_acceleration=40.0)
DT_S = 0.008
PERIODS_S = (0.0, 0.002, DT_S, 0.02)
WILD = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.floats(-2.5, 2.5))


def checked(max_jump: float = 0.5, soft: SoftJointLimits | None = None) -> CommandCheck:
    check = CommandCheck([CheckedJoint(name, LIMITS, soft) for name in NAMES], max_jump)
    check.reset([0.0, 0.0])
    return check


@settings(deadline=None)
@given(st.lists(st.tuples(WILD, WILD, st.sampled_from(PERIODS_S)), max_size=60))
def test_whatever_is_commanded_the_arm_is_sent_what_it_can_do(steps: list[tuple[float, float, float]]) -> None:
    check = checked()
    velocities = [0.0, 0.0]
    longer_cycles = 3.0 * (PERIODS_S[-1] - PERIODS_S[1]) / 2.0  # what cycles that become shorter take from braking
    for first, second, period_s in steps:
        before = list(check.sent)
        check.admit([first, second], period_s)
        if period_s == 0.0:
            assert check.sent == before
            continue
        new = [(sent - old) / period_s for sent, old in zip(check.sent, before, strict=True)]
        for velocity, old in zip(new, velocities, strict=True):
            assert abs(velocity) <= 3.0 * (1.0 + 1e-5)
            assert abs(velocity - old) <= 40.0 * period_s * (1.0 + 1e-5) + 1e-9
        assert max(map(abs, check.sent)) <= 2.0 + longer_cycles
        velocities = new


@settings(deadline=None)
@given(
    speed=st.floats(0.1, 3.0),
    end=st.floats(1.8, 2.0),
    period_s=st.sampled_from(PERIODS_S[1:]),
    afterwards=st.sampled_from(["it stays", "it goes back", "it is refused"]),
)
def test_a_command_that_stops_abruptly_at_the_end_of_the_range_does_not_send_the_arm_beyond(
    speed: float, end: float, period_s: float, afterwards: str
) -> None:
    check = checked()
    velocity = 0.0
    for cycle in range(1, round(end / speed / period_s) + 100):
        before, command = check.sent[0], min(speed * cycle * period_s, end)
        if command == end and afterwards != "it stays":
            command = end - 0.3 if afterwards == "it goes back" else math.nan
        check.admit([command, -command], period_s)
        assert max(map(abs, check.sent)) <= 2.0 + 1e-6
        new = (check.sent[0] - before) / period_s
        assert abs(new - velocity) <= 40.0 * period_s * (1.0 + 1e-5) + 1e-9
        velocity = new
    if afterwards == "it stays":
        assert check.sent == pytest.approx([end, -end], abs=1e-6)


@pytest.mark.parametrize("deceleration", [5.0, 39.9])
def test_a_command_that_brakes_in_time_is_followed_exactly_to_the_end_of_the_range(deceleration: float) -> None:
    check = checked(max_jump=4.0)
    half_s = 2.5 / deceleration
    start = 2.0 - deceleration * half_s * half_s
    check.reset([start, -start])
    for cycle in range(round(2.0 * half_s / DT_S) + 10):
        time_s = min(cycle * DT_S, 2.0 * half_s)
        way = 0.5 * deceleration * time_s * time_s
        if time_s > half_s:
            way = deceleration * (half_s * half_s - 0.5 * (2.0 * half_s - time_s) ** 2)
        assert check.admit([start + way, -start - way], DT_S) == ""
        assert check.sent == [start + way, -start - way]


@settings(deadline=None)
@given(amplitude=st.floats(0.01, 1.0), speed=st.floats(0.05, 2.5))
def test_a_motion_within_the_limits_reaches_the_arm_unchanged(amplitude: float, speed: float) -> None:
    check = checked()
    rate = speed / amplitude
    if amplitude * rate * rate > 35.0:
        rate = math.sqrt(35.0 / amplitude)
    for cycle in range(300):
        command = amplitude * (1.0 - math.cos(rate * cycle * DT_S))
        assert check.admit([command, -command], DT_S) == ""
        assert check.sent == [command, -command]


@settings(deadline=None)
@given(step=st.floats(-0.5, 0.5))
def test_a_step_is_made_a_motion_that_ends_at_it(step: float) -> None:
    check = checked()
    for _ in range(200):
        assert check.admit([step, 0.0], DT_S) == ""
        assert abs(check.sent[0]) <= abs(step) + 40.0 * DT_S * DT_S
    assert check.sent == pytest.approx([step, 0.0], abs=1e-9)


def test_a_motion_that_begins_too_fast_is_caught_up_with() -> None:
    check = checked()
    for cycle in range(1, 120):
        assert check.admit([1.0 * cycle * DT_S, 0.0], DT_S) == ""
    assert check.sent[0] == pytest.approx(1.0 * 119 * DT_S, abs=1e-9)


@pytest.mark.parametrize("command", [math.nan, math.inf, -math.inf, 2.1, -2.1, 0.7])
def test_a_command_that_cannot_be_meant_is_refused_with_its_joint(command: float) -> None:
    check = checked()
    reason = check.admit([0.0, command], DT_S)
    assert "joint 'elbow'" in reason and "holds" in reason
    assert check.sent == [0.0, 0.0]


def test_a_refused_command_brings_a_moving_arm_to_rest_and_the_next_good_one_goes_on() -> None:
    check = checked()
    for cycle in range(1, 60):
        check.admit([2.0 * (cycle * DT_S) ** 2, 0.0], DT_S)
    moving = check.sent[0]
    for _ in range(30):
        assert check.admit([math.nan, 0.0], DT_S) != ""
    rest = check.sent[0]
    assert moving < rest < moving + 0.1
    assert check.admit([math.nan, 0.0], DT_S) != "" and check.sent[0] == rest
    assert check.admit([rest, 0.0], DT_S) == ""


def test_the_refusal_says_what_was_got_and_what_is_allowed() -> None:
    assert "command 2.5 rad is outside its range [-2, 2] rad" in checked().admit([2.5, 0.0], DT_S)
    assert "at most 0.5 rad is allowed" in checked().admit([0.9, 0.0], DT_S)


@settings(deadline=None)
@given(speed=st.floats(0.1, 2.5), k_position=st.floats(2.0, 20.0), end=st.floats(0.2, 1.5))
def test_an_end_of_the_soft_range_is_approached_the_slower_the_nearer_and_not_passed(
    speed: float, k_position: float, end: float
) -> None:
    check = checked(max_jump=4.0, soft=SoftJointLimits(-1.9, end, k_position, 1.0))
    for cycle in range(1, 700):
        before = check.sent[0]
        assert check.admit([min(speed * cycle * DT_S, 1.9), 0.0], DT_S) == ""
        allowed = k_position * (end - before)
        assert (check.sent[0] - before) / DT_S <= allowed + 40.0 * DT_S + 1e-6
        assert check.sent[0] <= end + 40.0 * DT_S * DT_S
    if speed * 700 * DT_S > end:
        assert check.sent[0] <= end + 1e-3


def test_outside_the_soft_range_only_the_way_back_is_open_and_nothing_moves_by_itself() -> None:
    check = checked(soft=SoftJointLimits(-1.0, 1.0, 5.0, 1.0))
    check.reset([1.5, 0.0])
    for _ in range(50):
        assert check.admit([1.5, 0.0], DT_S) == ""
    assert check.sent[0] == 1.5
    for _ in range(50):
        check.admit([1.8, 0.0], DT_S)
    assert check.sent[0] == 1.5
    for _ in range(200):
        check.admit([1.2, 0.0], DT_S)
    assert check.sent[0] == pytest.approx(1.2, abs=40.0 * DT_S * DT_S)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_joint_outside_its_range_stays_there_until_it_is_sent_back_and_never_goes_further(side: float) -> None:
    check = checked()
    check.reset([side * 2.4, 0.0])
    for _ in range(50):
        assert check.admit([side * 2.4003, 0.0], DT_S) == "", "a position that was measured a little later"
    assert check.sent[0] == side * 2.4
    assert "outside its range" in check.admit([side * 2.5, 0.0], DT_S) and check.sent[0] == side * 2.4
    for _ in range(200):
        check.admit([side * 1.95, 0.0], DT_S)
    assert check.sent[0] == pytest.approx(side * 1.95, abs=1e-6)
    assert "outside its range" in check.admit([side * 2.4, 0.0], DT_S)


def test_as_little_beyond_the_range_as_trajectory_controllers_allow_is_followed_up_to_its_end() -> None:
    check = checked(max_jump=4.0)
    check.reset([1.99, 0.0])
    for _ in range(100):
        assert check.admit([2.0 + GOAL_TOLERANCE, 0.0], DT_S) == ""
    assert check.sent[0] == pytest.approx(2.0, abs=1e-6)


def test_the_limits_are_those_of_the_description_and_of_joint_limits_but_never_more_than_the_arm_can() -> None:
    description = """<robot name="arm"><link name="a"/><link name="b"/>
      <joint name="shoulder" type="revolute"><parent link="a"/><child link="b"/>
        <limit lower="-9" upper="1" velocity="99" effort="1"/>
        <safety_controller soft_lower_limit="-1" soft_upper_limit="0.5" k_position="15" k_velocity="2"/>
      </joint></robot>"""
    root = MappingNodeHandle(
        {
            "robot_description": description,
            "joint_limits": {
                "elbow": {
                    "has_position_limits": True,
                    "min_position": -0.5,
                    "max_position": 0.5,
                    "has_acceleration_limits": True,
                    "max_acceleration": 3.0,
                    "has_soft_limits": True,
                    "soft_lower_limit": -0.4,
                    "soft_upper_limit": 0.4,
                    "k_position": 10.0,
                    "k_velocity": 1.0,
                }
            },
        }
    )
    shoulder, elbow = read_checked_joints(["shoulder", "elbow"], root)
    assert (shoulder.limits.min_position, shoulder.limits.max_position) == (pytest.approx(-2.0 * math.pi), 1.0)
    assert (shoulder.limits.max_velocity, shoulder.limits.max_acceleration) == (pytest.approx(math.pi), 40.0)
    assert shoulder.soft == SoftJointLimits(-1.0, 0.5, 15.0, 2.0)
    assert (elbow.limits.min_position, elbow.limits.max_position, elbow.limits.max_acceleration) == (-0.5, 0.5, 3.0)
    assert elbow.soft == SoftJointLimits(-0.4, 0.4, 10.0, 1.0)


@pytest.mark.parametrize("what", ["velocity", "acceleration"])
def test_a_joint_that_could_not_move_is_refused_with_its_parameter(what: str) -> None:
    root = MappingNodeHandle({"joint_limits": {"elbow": {f"has_{what}_limits": True, f"max_{what}": 0.0}}})
    with pytest.raises(ParameterError, match=f"/joint_limits/elbow/max_{what}: got 0"):
        read_checked_joints(["elbow"], root)
