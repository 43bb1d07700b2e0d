# SPDX-License-Identifier: BSD-3-Clause
"""Replays a record: passes its contents to a task model as the messages that the task sent."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from modular_framework_core.task_constructor.machine_graph import Transition
from modular_framework_core.task_runner.record import MachineRecord, StateRecord
from modular_framework_ui.messages import MachineStatus, MachineStructure, TaskReport
from modular_framework_ui.recorded_episode import JointTrack, RecordedEpisode
from modular_framework_ui.recorded_task import RecordedTask
from modular_framework_ui.task_model import MAX_SAMPLES, TaskModel
from modular_framework_ui.task_state import ReplayedRecord

_Event = tuple[float, Callable[[], None]]


def replayed_model(episode: RecordedEpisode) -> TaskModel:
    """Returns a task model in its state at the end of an episode, with the whole history."""
    now_s = 0.0
    model = TaskModel(lambda: now_s, sample_period_s=0.0)
    replayed = _ReplayedMachines(model, episode.task)
    log: list[_Event] = [
        (line.time_s, partial(model.note_log, line.level, line.node, line.text)) for line in episode.log
    ]
    events: list[_Event] = [*replayed.events(), *log, *_joint_events(model, episode.joints)]
    for now_s, note in sorted(events, key=lambda event: event[0]):  # noqa: B007 - the clock reads now_s
        note()
    now_s = max(now_s, episode.task.ended_s)
    model.note_report(_end_report(episode))
    model.note_record(ReplayedRecord(title=episode.title, omissions=episode.omissions, marks=episode.milestones))
    return model


def _joint_events(model: TaskModel, track: JointTrack | None) -> list[_Event]:
    if track is None:
        return []
    step = -(-len(track.times_s) // MAX_SAMPLES)  # rounded up

    def note(row: int) -> None:
        model.note_joints(track.joints, {quantity: values[row] for quantity, values in track.values.items()})

    return [(float(track.times_s[row]), partial(note, row)) for row in range(0, len(track.times_s), max(step, 1))]


def _end_report(episode: RecordedEpisode) -> TaskReport:
    task = episode.task
    return TaskReport(
        task=task.name,
        event="task_end",
        state="",
        active=(),
        elapsed_s=task.ended_s,
        outcome=task.outcome,
        reason=episode.reason,
        succeeded=episode.succeeded,
    )


class _ReplayedMachines:
    """Derives reports and active states from the executions of the leaf states.

    Args:
        model: Model that receives the messages.
        task: Record of the task.
    """

    def __init__(self, model: TaskModel, task: RecordedTask) -> None:
        self._model, self._task = model, task
        self._root = f"/{task.name.replace('/', '_')}"
        self._machines = {machine.path: machine for machine in task.machines}
        self._active: dict[str, list[str]] = {path: [] for path in self._machines}
        self._started: dict[str, set[str]] = {path: set() for path in self._machines}

    def events(self) -> list[_Event]:
        """Returns the structures, and the start and end of each state, with their times [s]."""
        events: list[_Event] = [(-math.inf, partial(self._note_structure, machine)) for machine in self._task.machines]
        for state in self._task.states:
            events.append((state.started_s, partial(self._start, state)))
            if state.ended_s is not None:
                events.append((state.ended_s, partial(self._end, state)))
        return events

    def _note_structure(self, machine: MachineRecord) -> None:
        self._model.note_structure(
            MachineStructure(
                path=self._path(machine.path),
                children=machine.children,
                transitions=tuple(
                    Transition(start=label, outcome=outcome, target=target)
                    for outcome, label, target in machine.transitions
                ),
                outcomes=machine.outcomes,
            )
        )
        self._note_status(machine.path)

    def _start(self, state: StateRecord) -> None:
        self._report("start", state)
        outer, *inner = ["", *_enclosing(state.path)]
        for machine, path in zip([outer, *inner], [*inner, state.path], strict=True):
            label = path.rpartition("/")[2]
            if machine in self._active and label not in self._active[machine]:
                self._active[machine].append(label)
                self._started[machine].add(label)
                self._note_status(machine)

    def _end(self, state: StateRecord) -> None:
        self._report("end", state)
        path, outcome = state.path, state.outcome or ""
        while path:
            enclosing, _, label = path.rpartition("/")
            machine = self._machines.get(enclosing)
            if machine is None:
                return
            if label in self._active[enclosing]:
                self._active[enclosing].remove(label)
            if path in self._machines:  # so that a machine that starts again at once has a second run
                self._note_status(enclosing)
            if self._active[enclosing]:
                return
            if len(machine.initial) > 1:  # a concurrence, whose outcome follows from several states
                has_ended, outcome = self._started[enclosing] >= set(machine.children), ""
            else:
                targets = [to for given, start, to in machine.transitions if (given, start) == (outcome, label)]
                outcome = targets[0] if targets else ""
                has_ended = outcome in machine.outcomes
            if not has_ended:
                return  # the status changes with the next state, as in smach
            self._started[enclosing].clear()
            self._note_status(enclosing)
            path = enclosing

    def _note_status(self, machine: str) -> None:
        self._model.note_status(
            MachineStatus(
                path=self._path(machine),
                initial=self._machines[machine].initial,
                active=tuple(self._active[machine]),
            )
        )

    def _report(self, event: str, state: StateRecord) -> None:
        is_end = event == "end"
        time_s = state.ended_s if is_end and state.ended_s is not None else state.started_s
        self._model.note_report(
            TaskReport(
                task=self._task.name,
                event=event,
                state=state.path,
                active=() if is_end else (state.path,),
                elapsed_s=time_s,
                state_elapsed_s=time_s - state.started_s,
                outcome=state.outcome or "" if is_end else "",
                reason=state.reason if is_end else "",
                location=state.location,
                inputs=dict(state.inputs),
                outputs=dict(state.outputs) if is_end else {},
            )
        )

    def _path(self, machine: str) -> str:
        return f"{self._root}/{machine}" if machine else self._root


def _enclosing(path: str) -> list[str]:
    """Returns the paths of the nested machines around a state, the outermost first."""
    labels = path.split("/")[:-1]
    return ["/".join(labels[: depth + 1]) for depth in range(len(labels))]
