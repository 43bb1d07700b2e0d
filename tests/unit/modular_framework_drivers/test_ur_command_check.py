# SPDX-License-Identifier: BSD-3-Clause
"""What of the commands reaches the arm."""
from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_drivers.ur.command_check import CommandCheck, MotionLimits

NAMES = ("shoulder", "elbow")
LIMITS = [MotionLimits(name, -2.0, 2.0, 3.0, 40.0) for name in NAMES]
DT_S = 0.008
WILD = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.floats(-2.5, 2.5))


def checked(max_jump: float = 0.5) -> CommandCheck:
    check = CommandCheck(LIMITS, max_jump)
    check.reset([0.0, 0.0])
    return check


@settings(deadline=None)
@given(st.lists(st.tuples(WILD, WILD, st.sampled_from([0.0, 0.002, DT_S, 0.02])), max_size=60))
def test_whatever_is_commanded_the_arm_is_told_what_it_can_do(steps: list[tuple[float, float, float]]) -> None:
    check = checked()
    velocities = [0.0, 0.0]
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
        velocities = new


@settings(deadline=None)
@given(amplitude=st.floats(0.01, 1.5), speed=st.floats(0.05, 2.5))
def test_a_motion_within_the_limits_reaches_the_arm_unchanged(amplitude: float, speed: float) -> None:
    check = checked()
    rate = speed / amplitude
    if amplitude * rate * rate > 35.0:
        rate = math.sqrt(35.0 / amplitude)
    for cycle in range(300):
        command = amplitude * (1.0 - math.cos(rate * cycle * DT_S)) / 1.0
        if command > 2.0:
            break
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
    assert "at most 0.5 rad at once" in checked().admit([0.9, 0.0], DT_S)
