# SPDX-License-Identifier: BSD-3-Clause
"""Runs the state machine of a task in a thread, stops it on request and reports its result."""

from __future__ import annotations

import json
import os
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import smach
from modular_framework_core.files.atomic_files import write_atomically
from modular_framework_core.task_runner.record import FailureSummary, MachineRecord, StateRecord, TaskRecorder
from modular_framework_ros.stop_requests import stoppable

EXIT_SUCCEEDED = 0
EXIT_FAILED = 1
EXIT_NOT_RUN = 2


LOCATION_MARK = "(  # defined in "
"""Mark in generated modules before the location of a state in the task."""


@dataclass(frozen=True, slots=True)
class TaskResult:
    """Result of a task.

    Attributes:
        name: Name of the task.
        outcome: Outcome of the state machine, or "preempted" after a stop request, "error" after an exception, "not
            run" if the state machine could not be created.
        exit_code: 0 for the success outcome, 1 for other outcomes, 2 if the task could not be run.
        failures: Failed states, in order.
        error: Error outside of the states' own reasons; "" without an error.
    """

    name: str
    outcome: str
    exit_code: int
    failures: tuple[FailureSummary, ...] = ()
    error: str = ""

    @property
    def succeeded(self) -> bool:
        """Whether the task ended with its success outcome."""
        return self.exit_code == EXIT_SUCCEEDED

    def lines(self) -> list[str]:
        """Returns the lines of the report: the reasons of a failure and, last, the outcome."""
        lines: list[str] = []
        if not self.succeeded:
            if self.failures:
                lines.append(f"Task '{self.name}': states that failed, in order:")
                lines += [f"  {failure}" for failure in self.failures]
            if self.error:
                lines.append(f"Task '{self.name}': {self.error}")
        verdict = "SUCCEEDED" if self.succeeded else "FAILED"
        return [*lines, f"Task '{self.name}' ended with outcome '{self.outcome}': {verdict}"]


class TaskRun:
    """One run of a task. The state machine is created and executed in the run's own thread."""

    def __init__(self, name: str, factory: Callable[[], smach.Container], recorder: TaskRecorder) -> None:
        """Stores the parts of a run.

        Args:
            name: Name of the task.
            factory: Function that creates the state machine.
            recorder: Recorder of the states.
        """
        self._name = name
        self._factory = factory
        self._recorder = recorder
        self._machine: smach.Container | None = None
        self._stop_cause = ""
        self._stop = threading.Event()
        self._result: TaskResult | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name=f"task-{name}", daemon=True)

    def start(self) -> None:
        """Starts the thread and ties smach's shutdown check to the stop request of this run."""
        smach.set_shutdown_check(self._stop.is_set)
        self._thread.start()

    def request_stop(self, cause: str) -> None:
        """Asks the running states to stop. No further state starts; repeated requests have no effect.

        Args:
            cause: Origin of the request for the result, such as "SIGINT".
        """
        with self._lock:
            if self._stop.is_set():
                return
            self._stop_cause = cause
            self._stop.set()
            machine = self._machine
        if machine is not None:
            machine.request_preempt()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Waits for the end of the run and returns whether the run has ended."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def result(self) -> TaskResult:
        """Returns the result of the run. A run that has not ended counts as stopped but not ended in time."""
        if self._result is not None:
            return self._result
        active = ", ".join(self._recorder.active()) or "the construction of the state machine"
        return self._make_result(
            "preempted", EXIT_FAILED, f"stopped by {self._stop_cause}, but {active} did not end in time"
        )

    def _run(self) -> None:
        """Creates and executes the state machine; body of the thread."""
        try:
            with stoppable(self._stop.is_set):
                machine = self._factory()
        except Exception as error:  # constructors of users' states can raise anything
            smach.logdebug(traceback.format_exc())
            if self._stop.is_set():
                self._result = self._make_result("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
            else:
                text = f"the state machine could not be made: {_location_prefix(error)}{type(error).__name__}: {error}"
                self._result = self._make_result("not run", EXIT_NOT_RUN, text)
            return
        self._recorder.attach(machine)
        with self._lock:
            self._machine = machine
            stopped = self._stop.is_set()
        if stopped:
            self._result = self._make_result("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
            return
        self._result = self._execute(machine)

    def _execute(self, machine: smach.Container) -> TaskResult:
        try:
            outcome = str(machine.execute(smach.UserData()))
        except smach.InvalidUserCodeError as error:
            return self._make_result("error", EXIT_FAILED, str(error))
        except Exception as error:
            return self._make_result("error", EXIT_FAILED, f"{type(error).__name__}: {error}")
        if self._stop.is_set():
            return self._make_result("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
        success = outcome == machine.get_registered_outcomes()[0]
        return self._make_result(outcome, EXIT_SUCCEEDED if success else EXIT_FAILED, "")

    def _make_result(self, outcome: str, exit_code: int, error: str) -> TaskResult:
        return TaskResult(self._name, outcome, exit_code, self._recorder.failures(), error)


def _location_prefix(error: Exception) -> str:
    """Returns the task location of the state whose constructor raised, followed by ": "; "" if unknown."""
    lines = [frame.line or "" for frame in traceback.extract_tb(error.__traceback__)]
    locations = [line.partition(LOCATION_MARK)[2] for line in lines if LOCATION_MARK in line]
    return f"{locations[-1]}: " if locations else ""


def write_record(
    folder: Path,
    begun: float,
    result: TaskResult,
    records: tuple[StateRecord, ...],
    machines: tuple[MachineRecord, ...],
) -> Path:
    """Writes the record of one run as JSON, for tools that compare runs.

    The keys are ``task``, ``begun`` [s since 1970], ``outcome``, ``succeeded``, ``error``, ``states``, a list of
    ``StateRecord`` fields, and ``machines``, a list of ``MachineRecord`` fields.

    Args:
        folder: Output folder; created if missing.
        begun: Start time of the task [s since 1970].
        result: Result of the task.
        records: Records of the state executions.
        machines: Structures of the task's state machines.

    Returns:
        The path of the file, ``<task>_<date>_<time>_<process>.json``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamp = time.strftime("%Y%m%d_%H%M%S", time.gmtime(begun))
    path = folder / f"{result.name.replace('/', '_')}_{stamp}_{os.getpid()}.json"
    content = {
        "task": result.name,
        "begun": begun,
        "outcome": result.outcome,
        "succeeded": result.succeeded,
        "error": result.error,
        "states": [asdict(record) for record in records],
        "machines": [asdict(machine) for machine in machines],
    }
    write_atomically(path, json.dumps(content, indent=1))
    return path
