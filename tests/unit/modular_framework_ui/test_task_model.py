# SPDX-License-Identifier: BSD-3-Clause
"""The task model derives runs, outcomes and phases from the messages about a task."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from modular_framework_core.task_constructor.machine_graph import MachineFrame, StateBox, Transition
from modular_framework_ui.joint_history import Quantity
from modular_framework_ui.messages import MachineStatus, MachineStructure, ReportError, read_report
from modular_framework_ui.page_protocol import changes_text
from modular_framework_ui.task_model import MAX_RUNS, MAX_SAMPLES, SAMPLE_PERIOD_S, TaskModel
from modular_framework_ui.task_state import Phase, StateRun

PICK = MachineStructure(
    path="/pick",
    children=("Look", "Hold"),
    transitions=(
        Transition(start="Look", outcome="found", target="Hold"),
        Transition(start="Look", outcome="empty", target="gave_up"),
        Transition(start="Hold", outcome="held", target="done"),
        Transition(start="Hold", outcome="failed", target="gave_up"),
    ),
    outcomes=("done", "gave_up"),
)
HOLD = MachineStructure(
    path="/pick/Hold",
    children=("Close", "Lift"),
    transitions=(
        Transition(start="Close", outcome="closed", target="Lift"),
        Transition(start="Close", outcome="missed", target="failed"),
        Transition(start="Lift", outcome="lifted", target="held"),
        Transition(start="Lift", outcome="dropped", target="failed"),
    ),
    outcomes=("held", "failed"),
)


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def model(clock: Clock) -> TaskModel:
    return TaskModel(clock)


def note_active(model: TaskModel, path: str, *active: str, initial: tuple[str, ...] = ()) -> None:
    model.note_status(MachineStatus(path=path, initial=initial, active=active))


def report(model: TaskModel, event: str, elapsed_s: float, state: str = "", **values: Any) -> None:
    fields = {"task": "pick", "event": event, "state": state, "active": [], "elapsed_s": elapsed_s}
    model.note_report(read_report(json.dumps(fields | values)))


def runs_of(model: TaskModel) -> list[StateRun]:
    return list(model.changes_since(0).runs.values())


def last_run(model: TaskModel, path: str) -> StateRun:
    return [run for run in runs_of(model) if run.path == path][-1]


def test_without_messages_the_page_waits_for_a_task(model: TaskModel) -> None:
    changes = model.changes_since(0)
    assert (changes.task.phase, changes.task.number, changes.runs) == (Phase.WAITING, 0, {})
    assert model.frame() is None


def test_smach_alone_tells_runs_their_times_and_unambiguous_outcomes(model: TaskModel, clock: Clock) -> None:
    for structure in (PICK, HOLD):
        model.note_structure(structure)
    note_active(model, "/pick", "Look")
    clock.now_s += 2.0
    note_active(model, "/pick", "Hold")
    note_active(model, "/pick/Hold", "Close")
    assert last_run(model, "/pick/Look") == StateRun(path="/pick/Look", start_s=100.0, end_s=102.0, outcome="found")
    assert {run.path for run in runs_of(model) if run.end_s is None} == {"/pick/Hold", "/pick/Hold/Close"}
    assert last_run(model, "/pick/Hold").is_machine
    clock.now_s += 1.0
    note_active(model, "/pick/Hold", "Lift")
    note_active(model, "/pick/Hold")  # both outcomes of Lift end the machine
    note_active(model, "/pick")
    assert last_run(model, "/pick/Hold/Close").outcome == "closed"
    assert last_run(model, "/pick/Hold/Lift").outcome == ""
    task = model.changes_since(0).task
    assert (task.phase, task.start_s, task.end_s) == (Phase.ENDED, 100.0, 103.0)


def test_a_repeated_status_and_structure_change_nothing(model: TaskModel) -> None:
    for _ in range(2):
        model.note_structure(PICK)
        note_active(model, "/pick", "Look")
        revision = model.changes_since(0).revision
    assert (len(runs_of(model)), revision) == (1, 2)


def test_reports_give_outcomes_reasons_and_the_times_of_the_task(model: TaskModel, clock: Clock) -> None:
    report(model, "start", 0.5, "Look", active=["Look"])
    clock.now_s += 0.3  # smach is later than the report, as in run_task
    for structure in (PICK, HOLD):
        model.note_structure(structure)
    note_active(model, "/pick", "Look")
    clock.now_s += 1.7
    report(model, "end", 2.5, "Look", state_elapsed_s=2.0, outcome="found")
    note_active(model, "/pick", "Hold")
    report(model, "start", 2.5, "Hold/Close", active=["Hold/Close"])
    report(model, "running", 2.7, "Hold/Close", active=["Hold/Close"], feedback={"Hold/Close": "fingers close"})
    assert model.changes_since(0).task.feedback == {"/pick/Hold/Close": "fingers close"}
    report(model, "end", 3.5, "Hold/Close", state_elapsed_s=1.0, outcome="missed", reason="no object")
    note_active(model, "/pick/Hold")
    note_active(model, "/pick")
    report(model, "task_end", 3.6, outcome="gave_up", succeeded=False, reason="Hold/Close failed once: no object")

    assert last_run(model, "/pick/Look") == StateRun(path="/pick/Look", start_s=100.0, end_s=102.0, outcome="found")
    close = last_run(model, "/pick/Hold/Close")
    assert (close.outcome, close.reason, close.has_failed) == ("missed", "no object", True)
    assert (close.start_s, close.end_s) == pytest.approx((102.0, 103.0))
    hold = last_run(model, "/pick/Hold")
    assert (hold.outcome, hold.has_failed, hold.is_machine) == ("failed", True, True)
    task = model.changes_since(0).task
    assert (task.phase, task.outcome, task.reason) == (Phase.FAILED, "gave_up", "Hold/Close failed once: no object")
    assert (task.start_s, task.end_s) == pytest.approx((99.5, 103.1))
    assert len(runs_of(model)) == 3


def test_reports_give_the_line_and_the_userdata_of_a_state(model: TaskModel) -> None:
    read = {"location": "pick.yaml:7:5", "inputs": {"pose": "(0.1, 0.2, 0.3)"}}
    report(model, "start", 0.1, "Look", active=["Look"], **read)
    report(model, "end", 0.2, "Look", outcome="found", outputs={"grasp": "grasp_3"}, **read)
    run = last_run(model, "/pick/Look")
    assert (run.location, run.inputs, run.outputs) == (read["location"], read["inputs"], {"grasp": "grasp_3"})


def test_without_reports_a_state_has_the_userdata_of_its_machine_at_its_start(model: TaskModel) -> None:
    for active, width in (("Look", "0.04"), ("Look", "0.05"), ("Hold", "0.06")):
        model.note_status(MachineStatus(path="/pick", initial=(), active=(active,), userdata={"width": width}))
    assert last_run(model, "/pick/Look").inputs == {"width": "0.04"}
    assert last_run(model, "/pick/Hold").inputs == {"width": "0.06"}


def test_a_machine_that_is_no_longer_published_does_not_end_the_next_run_of_its_task(model: TaskModel) -> None:
    note_active(model, "/pick", "Look")
    report(model, "start", 0.1, "Look", active=["Look"])
    report(model, "task_end", 2.0, outcome="done", succeeded=True)
    report(model, "start", 0.1, "Look", active=["Look"])
    model.note_lost_machine("/pick")  # published by the first run
    assert model.changes_since(0).task.phase is Phase.RUNNING
    model.note_lost_reports("/pick")
    assert model.changes_since(0).task.phase is Phase.LOST


def test_a_machine_whose_end_is_seen_before_its_last_state_gets_its_outcome_later(model: TaskModel) -> None:
    for structure in (PICK, HOLD):
        model.note_structure(structure)
    report(model, "start", 0.1, "Hold/Lift", active=["Hold/Lift"])
    note_active(model, "/pick", "Hold")
    note_active(model, "/pick")
    assert last_run(model, "/pick/Hold").end_s is not None
    report(model, "end", 1.1, "Hold/Lift", state_elapsed_s=1.0, outcome="dropped", reason="slipped")
    assert last_run(model, "/pick/Hold").outcome == "failed"


def test_a_task_with_reports_that_succeeds(model: TaskModel) -> None:
    report(model, "start", 0.1, "Look", active=["Look"])
    report(model, "end", 0.2, "Look", outcome="found")
    report(model, "task_end", 0.3, outcome="done", succeeded=True)
    assert model.changes_since(0).task.phase is Phase.SUCCEEDED


def test_a_state_that_ends_after_its_task_starts_no_task(model: TaskModel) -> None:
    report(model, "start", 0.1, "Look", active=["Look"])
    report(model, "task_end", 1.0, outcome="preempted", reason="stopped by SIGINT")
    report(model, "end", 1.1, "Look", state_elapsed_s=1.0, outcome="empty", reason="stopped")
    model.note_structure(PICK)
    note_active(model, "/pick", "Look")  # the last status of a machine that was stopped
    task = model.changes_since(0).task
    assert (task.number, task.phase) == (1, Phase.FAILED)
    assert len(runs_of(model)) == 1


def test_the_same_task_started_again_is_a_new_task(model: TaskModel, clock: Clock) -> None:
    report(model, "start", 0.1, "Look", active=["Look"])
    report(model, "end", 2.0, "Look", outcome="found")
    report(model, "task_end", 2.1, outcome="done", succeeded=True)
    clock.now_s += 60.0
    report(model, "start", 0.2, "Hold", active=["Hold"])
    changes = model.changes_since(0)
    assert (changes.task.number, changes.task.phase) == (2, Phase.RUNNING)
    assert changes.task.start_s == pytest.approx(159.8)
    assert [(run.path, run.start_s) for run in changes.runs.values()] == [("/pick/Hold", pytest.approx(160.0))]


def test_a_report_that_arrives_twice_or_out_of_order_changes_no_run(model: TaskModel) -> None:
    report(model, "start", 5.0, "Look", active=["Look"])
    for _ in range(2):  # a latched message is received again after a reconnection
        report(model, "end", 6.0, "Look", state_elapsed_s=1.0, outcome="found")
    report(model, "running", 5.9, "Look")
    assert (len(runs_of(model)), model.changes_since(0).task.number) == (1, 1)


def test_a_page_that_starts_in_the_midst_of_a_task_knows_when_the_task_began(model: TaskModel) -> None:
    report(model, "running", 40.0, "Look", active=["Look"], state_elapsed_s=3.0)
    assert model.changes_since(0).task.start_s == pytest.approx(60.0)
    assert last_run(model, "/pick/Look").start_s == pytest.approx(97.0)


def test_a_node_that_dies_leaves_a_lost_task(model: TaskModel) -> None:
    model.note_structure(PICK)
    note_active(model, "/pick", "Look")
    model.note_lost_machine("/pick")
    changes = model.changes_since(0)
    assert (changes.task.phase, changes.task.end_s) == (Phase.LOST, 100.0)
    assert "node" in changes.task.reason
    assert [run.end_s for run in changes.runs.values()] == [100.0]
    note_active(model, "/pick", "Look")  # started again
    assert model.changes_since(0).task.number == 2


def test_the_end_of_a_node_after_its_task_changes_nothing(model: TaskModel) -> None:
    report(model, "start", 0.1, "Look", active=["Look"])
    report(model, "task_end", 1.0, outcome="done", succeeded=True)
    model.note_lost_machine("/pick")
    assert model.changes_since(0).task.phase is Phase.SUCCEEDED


def test_changes_are_those_after_the_revision_and_a_late_page_gets_everything(model: TaskModel) -> None:
    model.note_structure(PICK)
    note_active(model, "/pick", "Look")
    model.note_drawing("<svg/>")
    model.note_log("WARN", "/arm", "late")
    seen = model.changes_since(0)
    note_active(model, "/pick", "Hold")
    later = model.changes_since(seen.revision)
    assert later.drawing is None and later.log == {}
    assert {run.path: run.outcome for run in later.runs.values()} == {"/pick/Look": "found", "/pick/Hold": ""}
    late = model.changes_since(0)
    assert late.drawing == "<svg/>" and [line.text for line in late.log.values()] == ["late"]
    assert model.changes_since(later.revision).runs == {}


def test_the_oldest_runs_are_dropped_first(model: TaskModel) -> None:
    for number in range(MAX_RUNS + 10):
        report(model, "start", number / 100, "Look", active=["Look"])
        report(model, "end", number / 100 + 0.001, "Look", outcome="empty")
    changes = model.changes_since(0)
    assert (len(changes.runs), changes.oldest_run, min(changes.runs)) == (MAX_RUNS, 10, 10)


def test_the_joints_are_sampled_at_most_ten_times_a_second_while_a_task_runs(model: TaskModel, clock: Clock) -> None:
    def move(position: float) -> None:
        model.note_joints(["pan", "lift"], {Quantity.POSITION: [position, math.nan], Quantity.EFFORT: []})

    move(0.0)
    assert model.changes_since(0).samples == {}
    note_active(model, "/pick", "Look")
    for step in range(1, 6):
        model.note_joints(["lift"], {Quantity.ERROR: [0.01 * step]})
        move(0.1 * step)
        clock.now_s += SAMPLE_PERIOD_S / 2
    changes = model.changes_since(0)
    assert changes.joints == ("pan", "lift")
    assert [(sample.time_s, sample.values[0], sample.values[3]) for sample in changes.samples.values()] == [
        (pytest.approx(100.0 + SAMPLE_PERIOD_S * number), values, (None, error))
        for number, (values, error) in enumerate([((0.0, None), 0.01), ((0.2, None), 0.03), ((0.4, None), 0.05)])
    ]
    message = json.loads(changes_text(changes))["samples"][1]
    assert (message["index"], message["position"], message["velocity"]) == (1, [0.2, None], [None, None])


def test_a_page_gets_each_sample_once_and_the_oldest_are_dropped_first(model: TaskModel, clock: Clock) -> None:
    note_active(model, "/pick", "Look")
    seen = 0
    for _ in range(MAX_SAMPLES + 5):
        model.note_joints(["pan"], {Quantity.POSITION: [0.0]})
        clock.now_s += 2 * SAMPLE_PERIOD_S
        changes = model.changes_since(seen)
        assert len(changes.samples) == 1
        seen = changes.revision
    assert (model.changes_since(0).oldest_sample, len(model.changes_since(0).samples)) == (5, MAX_SAMPLES)


def test_the_frame_nests_machines_and_knows_a_concurrence_by_its_initial_states(model: TaskModel) -> None:
    for structure in (PICK, HOLD):
        model.note_structure(structure)
    note_active(model, "/pick/Hold", initial=("Close", "Lift"))
    note_active(model, "/pick", "Hold", initial=("Hold",))
    frame = model.frame()
    assert frame is not None
    assert (frame.label, frame.initial, frame.is_concurrent) == ("pick", ("Hold",), False)
    hold = frame.child("Hold")
    assert isinstance(hold, MachineFrame) and hold.is_concurrent
    assert hold.children == (StateBox(label="Close"), StateBox(label="Lift"))


def test_the_message_to_the_page_is_json_with_indices(model: TaskModel) -> None:
    model.note_structure(PICK)
    note_active(model, "/pick", "Look")
    message = json.loads(changes_text(model.changes_since(0)))
    assert message["task"]["phase"] == "running"
    assert message["runs"] == [
        {"index": 0, "path": "/pick/Look", "start_s": 100.0, "end_s": None, "outcome": "", "reason": "",
         "has_failed": False, "is_machine": False, "location": "", "inputs": {}, "outputs": {}}
    ]  # fmt: skip


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"task": "t", "event": "start", "state": "A", "active": 3, "elapsed_s": 0}']
)
def test_an_invalid_report_is_refused_with_the_expected_keys(text: str) -> None:
    with pytest.raises(ReportError, match="task_status: invalid report .*; allowed: JSON with task, event"):
        read_report(text)
