# SPDX-License-Identifier: BSD-3-Clause
"""The base of the framework's states: outcomes, reasons, waiting, stopping."""

from __future__ import annotations

import threading
import time

import pytest

import smach
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_ros.calls import CallError, call_service
from modular_framework_ros.stop_requests import stop_requested


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


@pytest.mark.parametrize(("outcomes", "expected"), [(["a", "b"], "b"), (["a", "preempted", "b"], "preempted")])
def test_a_stopped_state_services_the_request_and_can_wait_again(outcomes: list[str], expected: str) -> None:
    state = FrameworkState(outcomes)
    state.request_preempt()
    assert state.stopped() == expected
    assert not state.preempt_requested()
    assert state.wait_until(lambda: True, 1.0)


def test_a_shutdown_ends_a_wait() -> None:
    smach.set_shutdown_check(lambda: True)
    assert not FrameworkState().wait_until(lambda: True, None)


class SlowService:
    """A service that does not answer before the test is over."""

    resolved_name = "/slow"

    def __init__(self) -> None:
        self.called, self.over = threading.Event(), threading.Event()

    def __call__(self, request: object) -> None:
        self.called.set()
        self.over.wait(60.0)


class Asks(FrameworkState):
    """A state whose service is called by a function that knows nothing of the state."""

    def __init__(self, service: SlowService) -> None:
        super().__init__()
        self._service = service

    def execute(self, userdata: object) -> str:
        try:
            call_service(self._service, None, 60.0)
        except CallError as error:
            return self.fail(str(error))
        return self.succeed()


@pytest.mark.parametrize("whole_task", [False, True])
def test_a_request_to_stop_ends_a_call_that_is_not_answered(whole_task: bool) -> None:
    service, asked = SlowService(), threading.Event()
    state = Asks(service)
    smach.set_shutdown_check(asked.is_set)
    threading.Timer(0.1, asked.set if whole_task else state.request_preempt).start()
    begun = time.monotonic()
    assert state.execute(None) == "fail"
    service.over.set()
    assert time.monotonic() - begun < 5.0
    assert service.called.is_set() and state.reason == "stopped on request"
    assert not stop_requested()


def test_a_concurrence_that_has_its_outcome_ends_the_calls_of_its_other_states() -> None:
    service = SlowService()
    machine = smach.Concurrence(
        ["success", "fail"],
        "fail",
        child_termination_cb=lambda outcomes: True,
        outcome_map={"success": {"QUICK": "done"}},
    )
    with machine:
        smach.Concurrence.add("SLOW", Asks(service))
        smach.Concurrence.add("QUICK", smach.CBState(lambda userdata: "done", outcomes=["done"]))
    begun = time.monotonic()
    assert machine.execute() == "success"
    service.over.set()
    assert time.monotonic() - begun < 5.0


def test_a_call_outside_of_states_waits_as_long_as_it_may() -> None:
    service = SlowService()
    with pytest.raises(CallError, match="did not answer within 0.2 s"):
        call_service(service, None, 0.2)
    service.over.set()
