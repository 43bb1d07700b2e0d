# SPDX-License-Identifier: BSD-3-Clause
"""The time of the control loop: steps of the system's clock do not reach it, only the stamps of messages."""

from __future__ import annotations

import logging

import genpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control.controllers.joint_state_controller import JointStateSnapshot
from modular_framework_control.realtime.loop_time import MIN_STEP_S, LoopTime
from modular_framework_control.ros.conversions import joint_state_to_msg, trajectory_from_msg
from modular_framework_control.ros.trajectory_messages import CompactJointTrajectory


class Clocks:
    """A clock that can be set and one that cannot."""

    def __init__(self) -> None:
        self.steady_s, self.set_by_s, self.delay_s = 50.0, 1.7e9, 0.0

    def system(self) -> float:
        self.steady_s += self.delay_s
        return self.steady_s + self.set_by_s

    def steady(self) -> float:
        return self.steady_s


@given(st.lists(st.tuples(st.floats(1e-3, 1.0), st.floats(-1e6, 1e6)), min_size=1, max_size=20))
def test_time_passes_as_on_the_steady_clock_and_stamps_follow_the_one_that_is_set(
    cycles: list[tuple[float, float]],
) -> None:
    clocks = Clocks()
    loop_time = LoopTime(clocks.system, clocks.steady)
    before_s = loop_time.now()
    for passed_s, step_s in cycles:
        clocks.steady_s += passed_s
        clocks.set_by_s += step_s
        time_s = loop_time.now()
        assert time_s - before_s == pytest.approx(passed_s, abs=1e-6)
        assert time_s + loop_time.ahead_s == pytest.approx(clocks.system(), abs=MIN_STEP_S + 1e-6)
        before_s = time_s


def test_a_loop_that_is_held_up_between_its_two_clocks_does_not_take_that_for_a_step() -> None:
    clocks = Clocks()
    loop_time = LoopTime(clocks.system, clocks.steady)
    clocks.delay_s = 0.05
    loop_time.now()
    assert loop_time.ahead_s == 0.0


def test_time_stands_still_while_the_loop_is_held_up(caplog: pytest.LogCaptureFixture) -> None:
    clocks = Clocks()
    loop_time = LoopTime(clocks.system, clocks.steady)
    clocks.steady_s += 3.0  # before the loop begins nothing is held up
    loop_time.max_step_s = 0.05
    begun_s = loop_time.now()
    for passed_s in (0.008, 0.05, 0.9, 0.008):
        clocks.steady_s += passed_s
        time_s = loop_time.now()
        assert time_s + loop_time.ahead_s == pytest.approx(clocks.system(), abs=1e-6)
    assert time_s - begun_s == pytest.approx(0.008 + 0.05 + 0.05 + 0.008, abs=1e-6)
    assert [record.getMessage() for record in caplog.records] == [
        "the control loop was held up for 0.900 s: motions continue later"
    ]


def test_a_step_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    clocks = Clocks()
    loop_time = LoopTime(clocks.system, clocks.steady)
    clocks.set_by_s -= 3600.0
    with caplog.at_level(logging.WARNING):
        loop_time.now()
        loop_time.now()
    assert [record.getMessage() for record in caplog.records if "was set by -3600.000 s" in record.getMessage()] == [
        record.getMessage() for record in caplog.records
    ] and len(caplog.records) == 1


def test_stamps_of_messages_differ_from_the_time_of_the_loop_by_what_the_clock_is_ahead() -> None:
    sent = CompactJointTrajectory()
    sent.header.stamp = genpy.Time(1500)
    assert trajectory_from_msg(sent, 400.0).stamp_s == 1100.0
    assert trajectory_from_msg(CompactJointTrajectory(), 400.0).stamp_s == 0.0, "now stays now"
    message = joint_state_to_msg(JointStateSnapshot(1100.0, ["a"], [0.0], [0.0], [0.0]), 400.0)
    assert message.header.stamp == genpy.Time(1500)
