# SPDX-License-Identifier: BSD-3-Clause
"""Records what the states of a running task do: when each started and ended, with which outcome, and why.

The recorder observes any smach state, so a user's own states are recorded like the framework's.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import smach
from modular_framework_core.files.atomic_files import write_atomically


@dataclass(frozen=True, slots=True)
class StateRecord:
    """One execution of one state.

    Attributes:
        path: Labels from the root to the state, joined by "/".
        started_s: When it started [s since the task started].
        ended_s: When it ended [s since the task started]; None while it runs.
        outcome: What it returned; None while it runs, or when it raised.
        failed: Whether it ended with its negative (last) outcome, gave a reason, or raised.
        reason: Why, in words of the state; "" when it gave none.
        ros_started_s: When it started by the ROS clock, which is simulated time in simulation [s]; None without one.
        ros_ended_s: When it ended by the ROS clock [s]; None while it runs, or without one.
    """

    path: str
    started_s: float
    ended_s: float | None = None
    outcome: str | None = None
    failed: bool = False
    reason: str = ""
    ros_started_s: float | None = None
    ros_ended_s: float | None = None


@dataclass(frozen=True, slots=True)
class RunningState:
    """A state that runs now.

    Attributes:
        path: Labels from the root to the state, joined by "/".
        elapsed_s: For how long it has been running [s].
        feedback: What the state reports that it is doing; "" without a report.
    """

    path: str
    elapsed_s: float
    feedback: str


@dataclass(frozen=True, slots=True)
class FailureSummary:
    """All executions of one state that failed.

    Attributes:
        path: Labels from the root to the state.
        failures: How often it failed.
        executions: How often it ran.
        last_reason: Why it failed the last time.
        different_reasons: How many different reasons it gave.
    """

    path: str
    failures: int
    executions: int
    last_reason: str
    different_reasons: int

    def __str__(self) -> str:
        times = "once" if self.failures == 1 else f"{self.failures} times"
        of = "" if self.executions == self.failures else f" of {self.executions}"
        more = f" (the last of {self.different_reasons} different reasons)" if self.different_reasons > 1 else ""
        return f"{self.path} failed {times}{of}: {self.last_reason}{more}"


Listener = Callable[[StateRecord, tuple[str, ...]], None]
"""Called at the start and the end of each state with its record and the paths of the states that run now."""


class TaskRecorder:
    """Keeps the records of one run of one task; safe to use from several threads."""

    def __init__(
        self,
        listener: Listener | None = None,
        clock: Callable[[], float] = time.monotonic,
        ros_clock: Callable[[], float | None] = lambda: None,
    ) -> None:
        """Starts the task's clock.

        Args:
            listener: Notified of each start and end of a state that has no children.
            clock: Returns the time [s].
            ros_clock: Returns the time by the ROS clock [s].
        """
        self._listener = listener
        self._clock = clock
        self._ros_clock = ros_clock
        self._zero = clock()
        self._lock = threading.Lock()
        self._notify_lock = threading.Lock()
        self._records: list[StateRecord] = []
        self._active: dict[int, tuple[str, smach.State]] = {}

    def elapsed_s(self) -> float:
        """Returns the time since the task started [s]."""
        return self._clock() - self._zero

    def attach(self, machine: smach.Container) -> None:
        """Records every state in a machine and in the machines nested in it from now on."""
        for label, child in machine.get_children().items():
            self._attach_state(child, label)

    def _attach_state(self, state: smach.State, path: str) -> None:
        if isinstance(state, smach.Container):
            for label, child in state.get_children().items():
                self._attach_state(child, f"{path}/{label}")
            return
        execute = state.execute

        def recorded(userdata: Any) -> str:
            for text in ("reason", "feedback"):
                if hasattr(state, text):
                    setattr(state, text, "")
            number = self._begin(path, state)
            try:
                outcome = execute(userdata)
            except BaseException as error:
                self._end(number, None, True, f"raised {type(error).__name__}: {error}")
                raise
            reason = str(getattr(state, "reason", "") or "")
            outcomes = state.get_registered_outcomes()
            negative = len(outcomes) > 1 and outcome == outcomes[-1]
            self._end(number, outcome, negative or bool(reason), reason)
            return outcome

        state.execute = recorded  # type: ignore[method-assign]

    def _begin(self, path: str, state: smach.State) -> int:
        with self._lock:
            number = len(self._records)
            self._records.append(StateRecord(path, self.elapsed_s(), ros_started_s=self._ros_clock()))
            self._active[number] = path, state
        self._notify(number)
        return number

    def _end(self, number: int, outcome: str | None, failed: bool, reason: str) -> None:
        with self._lock:
            self._active.pop(number, None)
            if failed and not reason:
                reason = f"gave '{outcome}' and no reason"
            self._records[number] = replace(
                self._records[number],
                ended_s=self.elapsed_s(),
                outcome=outcome,
                failed=failed,
                reason=reason,
                ros_ended_s=self._ros_clock(),
            )
        self._notify(number)

    def _notify(self, number: int) -> None:
        if self._listener is None:
            return
        with self._notify_lock:  # so that the last notification has the current states
            with self._lock:
                record, active = self._records[number], tuple(path for path, _ in self._active.values())
            self._listener(record, active)

    def records(self) -> tuple[StateRecord, ...]:
        """Returns all records, in the order the states started."""
        with self._lock:
            return tuple(self._records)

    def active(self) -> tuple[str, ...]:
        """Returns the paths of the states that run now."""
        with self._lock:
            return tuple(path for path, _ in self._active.values())

    def running(self) -> tuple[RunningState, ...]:
        """Returns the running states with their elapsed times and feedback."""
        now = self.elapsed_s()
        with self._lock:
            return tuple(
                RunningState(path, now - self._records[number].started_s, str(getattr(state, "feedback", "")))
                for number, (path, state) in self._active.items()
            )

    def failures(self) -> tuple[FailureSummary, ...]:
        """Returns one summary for each state that failed, in the order they failed first."""
        records = self.records()
        paths = dict.fromkeys(record.path for record in records if record.failed)
        summaries = []
        for path in paths:
            mine = [record for record in records if record.path == path]
            reasons = [record.reason for record in mine if record.failed]
            summaries.append(FailureSummary(path, len(reasons), len(mine), reasons[-1], len(set(reasons))))
        return tuple(summaries)


def write_record(
    folder: Path, task: str, begun: float, outcome: str, succeeded: bool, error: str, records: tuple[StateRecord, ...]
) -> Path:
    """Writes the record of one run as JSON, for tools that compare runs.

    The file has ``task``, ``begun`` [s since 1970], ``outcome``, ``succeeded``, ``error`` and ``states``: for each
    execution of a state the fields of ``StateRecord``, times in seconds since the task started.

    Args:
        folder: Where to write; made when it is not there.
        task: Name of the task.
        begun: When the task started [s since 1970].
        outcome: Outcome of the task.
        succeeded: Whether that is its success outcome.
        error: What went wrong outside of the states' own reasons; "" when nothing did.
        records: What the states did.

    Returns:
        The path of the file: ``<task>_<date>_<time>_<process>.json``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamp = time.strftime("%Y%m%d_%H%M%S", time.gmtime(begun))
    path = folder / f"{task.replace('/', '_')}_{stamp}_{os.getpid()}.json"
    content = {
        "task": task,
        "begun": begun,
        "outcome": outcome,
        "succeeded": succeeded,
        "error": error,
        "states": [asdict(record) for record in records],
    }
    write_atomically(path, json.dumps(content, indent=1))
    return path
