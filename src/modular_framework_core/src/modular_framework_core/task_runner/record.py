# SPDX-License-Identifier: BSD-3-Clause
"""Records the start, end, outcome, reason and userdata of every state execution of a task, for any smach state."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import smach
from modular_framework_core.task_runner.userdata_text import WatchedUserdata, userdata_texts


@dataclass(frozen=True, slots=True)
class StateRecord:
    """One execution of a state.

    Attributes:
        path: Labels from the root to the state, joined by "/".
        started_s: Start time [s since the start of the task].
        ended_s: End time [s since the start of the task]; None while running.
        outcome: Outcome; None while running or after an exception.
        failed: Whether the state returned its negative (last) outcome, gave a reason, or raised an exception.
        reason: Reason given by the state; "" without a reason.
        ros_started_s: Start time on the ROS clock [s]; None without a ROS clock.
        ros_ended_s: End time on the ROS clock [s]; None while running or without a ROS clock.
        location: Position of the definition in the task, as "file:line:column"; "" if unknown.
        inputs: Text of each input key of the userdata at the start.
        outputs: Text of each userdata value that the state wrote.
    """

    path: str
    started_s: float
    ended_s: float | None = None
    outcome: str | None = None
    failed: bool = False
    reason: str = ""
    ros_started_s: float | None = None
    ros_ended_s: float | None = None
    location: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class MachineRecord:
    """Structure of a state machine of a task.

    Attributes:
        path: Labels from the root to the machine, joined by "/"; "" for the root.
        children: Labels of the states, in order.
        initial: Labels of the initial states; a concurrence has several.
        transitions: Outcome, label of the state, and next label or outcome of the machine.
        outcomes: Outcomes of the machine.
    """

    path: str
    children: tuple[str, ...]
    initial: tuple[str, ...]
    transitions: tuple[tuple[str, str, str], ...]
    outcomes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RunningState:
    """A running state.

    Attributes:
        path: Labels from the root to the state, joined by "/".
        elapsed_s: Time since the start of the state [s].
        feedback: Activity reported by the state; "" without a report.
        location: Position of the definition in the task; "" if unknown.
        inputs: Text of each input key of the userdata at the start.
    """

    path: str
    elapsed_s: float
    feedback: str
    location: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FailureSummary:
    """Summary of a state's failures.

    Attributes:
        path: Labels from the root to the state.
        failures: Number of failed executions.
        executions: Number of executions.
        last_reason: Reason of the last failure.
        different_reasons: Number of different reasons.
    """

    path: str
    failures: int
    executions: int
    last_reason: str
    different_reasons: int

    def __str__(self) -> str:
        times = "once" if self.failures == 1 else f"{self.failures} times"
        total = "" if self.executions == self.failures else f" of {self.executions}"
        note = f" (the last of {self.different_reasons} different reasons)" if self.different_reasons > 1 else ""
        return f"{self.path} failed {times}{total}: {self.last_reason}{note}"


Listener = Callable[[StateRecord, tuple[str, ...]], None]
"""Function called at the start and end of each state, with the state's record and the paths of all running states."""


class TaskRecorder:
    """Keeps the records of one run of a task. All methods are thread-safe."""

    def __init__(
        self,
        listener: Listener | None = None,
        clock: Callable[[], float] = time.monotonic,
        ros_clock: Callable[[], float | None] = lambda: None,
        *,
        locations: Mapping[str, str] | None = None,
    ) -> None:
        """Stores the start time of the task.

        Args:
            listener: Function called at each start and end of a leaf state.
            clock: Function that returns the time [s].
            ros_clock: Function that returns the ROS time [s].
            locations: Position of each state's definition in the task, keyed by path.
        """
        self._listener = listener
        self._clock = clock
        self._ros_clock = ros_clock
        self._locations = dict(locations or {})
        self._start_s = clock()
        self._lock = threading.Lock()
        self._notify_lock = threading.Lock()
        self._records: list[StateRecord] = []
        self._machines: list[MachineRecord] = []
        self._active: dict[int, tuple[str, smach.State]] = {}

    def elapsed_s(self) -> float:
        """Returns the time since the task started [s]."""
        return self._clock() - self._start_s

    def attach(self, machine: smach.Container) -> None:
        """Starts recording all states of a machine, including nested machines."""
        self._add_machine(machine, "")
        for label, child in machine.get_children().items():
            self._attach_state(child, label)

    def _add_machine(self, machine: smach.Container, path: str) -> None:
        edges = machine.get_internal_edges()
        record = MachineRecord(
            path=path,
            children=tuple(map(str, machine.get_children())),
            initial=tuple(map(str, machine.get_initial_states())),
            transitions=tuple((str(outcome), str(label), str(target)) for outcome, label, target in edges),
            outcomes=tuple(map(str, machine.get_registered_outcomes())),
        )
        with self._lock:
            self._machines.append(record)

    def _attach_state(self, state: smach.State, path: str) -> None:
        if isinstance(state, smach.Container):
            self._add_machine(state, path)
            for label, child in state.get_children().items():
                self._attach_state(child, f"{path}/{label}")
            return
        execute = state.execute

        def execute_and_record(userdata: Any) -> str:
            for attribute in ("reason", "feedback"):
                if hasattr(state, attribute):
                    setattr(state, attribute, "")
            index = self._begin(path, state, userdata_texts(userdata, state.get_registered_input_keys()))
            watched = WatchedUserdata(userdata)
            try:
                outcome = execute(watched)
            except BaseException as error:
                self._end(index, None, True, f"raised {type(error).__name__}: {error}")
                raise
            reason = str(getattr(state, "reason", "") or "")
            outcomes = state.get_registered_outcomes()
            negative = len(outcomes) > 1 and outcome == outcomes[-1]
            self._end(index, outcome, negative or bool(reason), reason, watched.written_texts())
            return outcome

        state.execute = execute_and_record  # type: ignore[method-assign]

    def _begin(self, path: str, state: smach.State, inputs: Mapping[str, str]) -> int:
        location = self._locations.get(path, "")
        with self._lock:
            index = len(self._records)
            record = StateRecord(
                path, self.elapsed_s(), ros_started_s=self._ros_clock(), location=location, inputs=inputs
            )
            self._records.append(record)
            self._active[index] = path, state
        self._notify(index)
        return index

    def _end(
        self, index: int, outcome: str | None, failed: bool, reason: str, outputs: Mapping[str, str] | None = None
    ) -> None:
        with self._lock:
            self._active.pop(index, None)
            if failed and not reason:
                reason = f"gave '{outcome}' and no reason"
            self._records[index] = replace(
                self._records[index],
                ended_s=self.elapsed_s(),
                outcome=outcome,
                failed=failed,
                reason=reason,
                ros_ended_s=self._ros_clock(),
                outputs=outputs or {},
            )
        self._notify(index)

    def _notify(self, index: int) -> None:
        if self._listener is None:
            return
        with self._notify_lock:  # keeps the notifications in order
            with self._lock:
                record, active = self._records[index], tuple(path for path, _ in self._active.values())
            self._listener(record, active)

    def records(self) -> tuple[StateRecord, ...]:
        """Returns all records, in the order of their start."""
        with self._lock:
            return tuple(self._records)

    def machines(self) -> tuple[MachineRecord, ...]:
        """Returns the structures of all machines, the root first."""
        with self._lock:
            return tuple(self._machines)

    def active(self) -> tuple[str, ...]:
        """Returns the paths of the running states."""
        with self._lock:
            return tuple(path for path, _ in self._active.values())

    def running(self) -> tuple[RunningState, ...]:
        """Returns the running states with their elapsed times and feedback."""
        now = self.elapsed_s()
        with self._lock:
            return tuple(
                RunningState(
                    path,
                    now - self._records[index].started_s,
                    str(getattr(state, "feedback", "")),
                    self._records[index].location,
                    self._records[index].inputs,
                )
                for index, (path, state) in self._active.items()
            )

    def failures(self) -> tuple[FailureSummary, ...]:
        """Returns one summary per failed state, in the order of first failure."""
        records = self.records()
        paths = dict.fromkeys(record.path for record in records if record.failed)
        summaries = []
        for path in paths:
            executions = [record for record in records if record.path == path]
            reasons = [record.reason for record in executions if record.failed]
            summaries.append(FailureSummary(path, len(reasons), len(executions), reasons[-1], len(set(reasons))))
        return tuple(summaries)
