# SPDX-License-Identifier: BSD-3-Clause
"""Running a task: its result, what is recorded of its states, and stopping."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest

import smach
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.task_runner.record import MachineRecord, StateRecord, TaskRecorder
from modular_framework_core.task_runner.task_runner import TaskResult, TaskRun


class Try(FrameworkState):
    """Gives reasons for failing, one an execution, then succeeds."""

    def __init__(self, *reasons: str) -> None:
        super().__init__()
        self._reasons = list(reasons)

    def execute(self, userdata: Any) -> str:
        return self.fail(self._reasons.pop(0)) if self._reasons else self.succeed()


class Stay(FrameworkState):
    """Runs until it is stopped."""

    def execute(self, userdata: Any) -> str:
        assert not self.wait_until(lambda: False, 10.0)
        return self.stopped()


class Blind(smach.State):
    """A state of a user who does not know of reasons; ends when an event is set."""

    def __init__(self, end: threading.Event, outcome: str = "fail") -> None:
        super().__init__(outcomes=["success", "fail"])
        self._end, self._outcome = end, outcome

    def execute(self, userdata: Any) -> str:
        assert self._end.wait(10.0)
        return self._outcome


def machine(**states: tuple[smach.State, dict[str, str]]) -> smach.StateMachine:
    made = smach.StateMachine(["done", "gave_up"])
    with made:
        for label, (state, transitions) in states.items():
            smach.StateMachine.add(label, state, transitions)
    return made


def run(made: smach.Container, recorder: TaskRecorder | None = None) -> TaskResult:
    running = TaskRun("tiny", lambda: made, recorder or TaskRecorder())
    running.start()
    assert running.wait(10.0)
    return running.result()


ENDS = {"success": "done", "fail": "gave_up"}


def test_the_first_outcome_is_success_and_gives_0() -> None:
    result = run(machine(A=(Try(), ENDS)))
    assert (result.outcome, result.exit_code, result.succeeded) == ("done", 0, True)
    assert result.lines() == ["Task 'tiny' ended with outcome 'done': SUCCEEDED"]


def test_another_outcome_gives_1_and_the_reasons_in_the_order_they_came() -> None:
    made = machine(
        Plan=(Try("too far", "too far", "in collision"), {"success": "Last", "fail": "Next"}),
        Next=(Try(), {"success": "Plan", "fail": "gave_up"}),
        Last=(Try("nothing left"), ENDS),
    )
    result = run(made)
    assert result.exit_code == 1
    assert result.lines() == [
        "Task 'tiny': states that failed, in order:",
        "  Plan failed 3 times of 4: in collision (the last of 2 different reasons)",
        "  Last failed once: nothing left",
        "Task 'tiny' ended with outcome 'gave_up': FAILED",
    ]


def test_a_reason_is_not_kept_for_the_next_execution() -> None:
    state = Try("no way")
    result = run(machine(A=(state, {"success": "done", "fail": "A"})))
    assert [(failure.failures, failure.executions) for failure in result.failures] == [(1, 2)]
    assert state.reason == ""


def test_a_state_that_gives_no_reason_is_reported_by_its_outcome() -> None:
    end = threading.Event()
    end.set()
    result = run(machine(A=(Blind(end), ENDS)))
    assert str(result.failures[0]) == "A failed once: gave 'fail' and no reason"


def test_a_state_that_raises_ends_the_task_with_error() -> None:
    class Burst(FrameworkState):
        def execute(self, userdata: Any) -> str:
            raise RuntimeError("a tyre burst")

    result = run(machine(A=(Burst(), ENDS)))
    assert (result.outcome, result.exit_code) == ("error", 1)
    assert "a tyre burst" in result.error
    assert str(result.failures[0]) == "A failed once: raised RuntimeError: a tyre burst"


def test_a_machine_that_cannot_be_made_gives_2() -> None:
    def refuse() -> smach.Container:
        raise ValueError("no arm")

    running = TaskRun("tiny", refuse, TaskRecorder())
    running.start()
    assert running.wait(10.0)
    assert running.result().exit_code == 2
    assert "the state machine could not be made: ValueError: no arm" in running.result().error


def test_nested_and_concurrent_states_are_recorded_with_their_paths() -> None:
    both = smach.Concurrence(["done", "gave_up"], "gave_up")
    with both:
        smach.Concurrence.add("A", Try("a"))
        smach.Concurrence.add("B", Try("b"))
    recorder = TaskRecorder()
    run(machine(Both=(both, {})), recorder)
    assert {record.path for record in recorder.records()} == {"Both/A", "Both/B"}
    assert all(record.failed and record.ended_s is not None for record in recorder.records())


def test_the_listener_hears_the_start_and_the_end_of_each_state() -> None:
    heard: list[tuple[str, str | None, tuple[str, ...]]] = []

    def listen(record: StateRecord, active: tuple[str, ...]) -> None:
        heard.append((record.path, record.outcome, active))

    run(machine(A=(Try(), ENDS)), TaskRecorder(listen))
    assert heard == [("A", None, ("A",)), ("A", "success", ())]


def test_a_record_has_the_userdata_that_a_state_read_and_wrote_and_its_line_in_the_task() -> None:
    class Choose(FrameworkState):
        def __init__(self) -> None:
            super().__init__(input_keys=["given", "unset"], output_keys=["chosen"])

        def execute(self, userdata: Any) -> str:
            userdata.chosen = userdata.given * 2
            return self.succeed()

    made = machine(A=(Choose(), ENDS))
    made.userdata.given = 1.5
    recorder = TaskRecorder(locations={"A": "pick.yaml:7:5"})
    run(made, recorder)
    (record,) = recorder.records()
    assert (record.inputs, record.outputs, record.location) == ({"given": "1.5"}, {"chosen": "3"}, "pick.yaml:7:5")
    assert made.userdata.chosen == 3.0


def test_a_record_has_the_structure_of_each_machine() -> None:
    inner = machine(B=(Try(), ENDS))
    recorder = TaskRecorder()
    run(machine(A=(Try(), {"success": "Inner", "fail": "gave_up"}), Inner=(inner, {})), recorder)
    root, nested = recorder.machines()
    assert (root.path, root.children, root.initial, root.outcomes) == ("", ("A", "Inner"), ("A",), ("done", "gave_up"))
    assert set(root.transitions) >= {("success", "A", "Inner"), ("fail", "A", "gave_up"), ("done", "Inner", "done")}
    assert nested == MachineRecord("Inner", ("B",), ("B",), nested.transitions, ("done", "gave_up"))


def test_times_are_those_of_the_clock() -> None:
    times = iter([10.0, 12.0, 15.0])
    recorder = TaskRecorder(clock=lambda: next(times))
    run(machine(A=(Try(), ENDS)), recorder)
    assert [(record.started_s, record.ended_s) for record in recorder.records()] == [(2.0, 5.0)]


def started(recorder: TaskRecorder, path: str) -> None:
    end = time.monotonic() + 5.0
    while path not in recorder.active():
        assert time.monotonic() < end, f"{path} did not start"
        time.sleep(0.005)


@pytest.mark.parametrize("label", ["A", "Inner/A"])
def test_a_request_to_stop_ends_a_machine_that_would_go_on(label: str) -> None:
    made = machine(A=(Stay(), {"success": "done", "fail": "A"}))
    if "/" in label:
        made = machine(Inner=(made, {"done": "Inner", "gave_up": "Inner"}))
    recorder = TaskRecorder()
    running = TaskRun("tiny", lambda: made, recorder)
    running.start()
    started(recorder, label)
    running.request_stop("SIGINT")
    running.request_stop("another")
    assert running.wait(2.0)
    result = running.result()
    assert (result.outcome, result.exit_code) == ("preempted", 1)
    assert result.error == "stopped by SIGINT"
    assert len(recorder.records()) == 1


def test_a_request_to_stop_while_the_machine_is_made_starts_no_state() -> None:
    making, go_on = threading.Event(), threading.Event()
    recorder = TaskRecorder()

    def make() -> smach.Container:
        making.set()
        assert go_on.wait(5.0)
        return machine(A=(Try(), ENDS))

    running = TaskRun("tiny", make, recorder)
    running.start()
    assert making.wait(5.0)
    running.request_stop("SIGINT")
    go_on.set()
    assert running.wait(5.0)
    assert running.result().outcome == "preempted"
    assert recorder.records() == ()


def test_a_state_that_does_not_stop_is_named() -> None:
    end = threading.Event()
    recorder = TaskRecorder()
    running = TaskRun("tiny", lambda: machine(A=(Blind(end), ENDS)), recorder)
    running.start()
    started(recorder, "A")
    running.request_stop("SIGTERM")
    assert not running.wait(0.1)
    assert running.result().error == "stopped by SIGTERM, but A did not end in time"
    assert running.result().exit_code == 1
    end.set()
    assert running.wait(5.0)
