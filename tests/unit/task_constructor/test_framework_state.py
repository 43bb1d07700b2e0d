# SPDX-License-Identifier: BSD-3-Clause
"""The base of the framework's states: outcomes, reasons, waiting, stopping."""
from __future__ import annotations

import threading
import time

import pytest

import smach
from modular_framework_core.framework_state import FrameworkState


def test_the_first_outcome_is_positive_and_the_last_negative() -> None:
    state = FrameworkState(outcomes=["good", "so_so", "bad"])
    assert (state.succeed(), state.fail("why")) == ("good", "bad")
    assert state.outcomes == ["good", "so_so", "bad"]


@pytest.mark.parametrize("outcomes", [[], ["only"], ["same", "same"], "success"])
def test_fewer_than_two_outcomes_are_refused(outcomes: list[str]) -> None:
    with pytest.raises(ValueError, match="FrameworkState: outcomes are"):
        FrameworkState(outcomes=outcomes)


def test_the_reason_is_kept_logged_and_forgotten_after_a_success() -> None:
    before = (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr)
    heard: list[str] = []
    smach.set_loggers(before[0], heard.append, before[2], before[3])
    try:
        state = FrameworkState()
        state.fail("the door is locked")
        assert state.reason == "the door is locked"
        assert heard == ["FrameworkState: the door is locked"]
        state.succeed()
        assert state.reason == ""
    finally:
        smach.set_loggers(*before)


def test_waiting_ends_when_the_condition_holds_or_the_time_is_over() -> None:
    state = FrameworkState()
    answers = iter([False, False, True])
    assert state.wait_until(lambda: next(answers), 5.0, period_s=0.001)
    assert not state.wait_until(lambda: False, 0.01)
    assert state.wait_until(lambda: True, 0.0)


@pytest.mark.parametrize("timeout_s", [None, 60.0])
def test_a_request_to_stop_ends_a_wait_at_once(timeout_s: float | None) -> None:
    state = FrameworkState()
    threading.Timer(0.05, state.request_preempt).start()
    begun = time.monotonic()
    assert not state.wait_until(lambda: False, timeout_s, period_s=30.0)
    assert time.monotonic() - begun < 5.0
    assert state.preempt_requested()


@pytest.mark.parametrize(
    ("outcomes", "expected"), [(["a", "b"], "b"), (["a", "preempted", "b"], "preempted")]
)
def test_a_stopped_state_services_the_request_and_can_wait_again(outcomes: list[str], expected: str) -> None:
    state = FrameworkState(outcomes)
    state.request_preempt()
    assert state.stopped() == expected
    assert not state.preempt_requested()
    assert state.wait_until(lambda: True, 1.0)


def test_a_shutdown_ends_a_wait() -> None:
    smach.set_shutdown_check(lambda: True)
    assert not FrameworkState().wait_until(lambda: True, None)
