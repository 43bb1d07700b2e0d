# SPDX-License-Identifier: BSD-3-Clause
"""Runs the state machine of a task in a thread, stops it when asked, and reports how it ended."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass

import smach
from modular_framework_core.task_runner.record import FailureSummary, TaskRecorder
from modular_framework_ros.stop_requests import stoppable

EXIT_SUCCEEDED = 0
EXIT_FAILED = 1
EXIT_NOT_RUN = 2


LOCATION_MARK = "(  # defined in "
"""Separator that generated modules write between the call of a state's class and its location in the task."""


@dataclass(frozen=True, slots=True)
class TaskResult:
    """Result of a task.

    Attributes:
        name: Name of the task.
        outcome: Outcome of its machine; "preempted" when it was stopped, "error" when a state raised, "not run" when
            its machine could not be made.
        exit_code: 0 for the success outcome, 1 for any other, 2 when the task could not be run.
        failures: The states that failed, in order.
        error: What went wrong outside of the states' own reasons; "" when nothing did.
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
        """Returns the report for the user: the reasons when it did not succeed, and the outcome in the last line."""
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
    """One run of one task. Making the machine and executing it both happen in the run's own thread."""

    def __init__(self, name: str, factory: Callable[[], smach.Container], recorder: TaskRecorder) -> None:
        """Stores the parts of a run.

        Args:
            name: Name of the task.
            factory: Makes the state machine.
            recorder: Records its states.
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
        """Starts the thread. From here on ``smach`` shuts down when the run is asked to stop."""
        smach.set_shutdown_check(self._stop.is_set)
        self._thread.start()

    def request_stop(self, cause: str) -> None:
        """Asks the running states to stop; no state is started after this. Further requests change nothing.

        Args:
            cause: Who asked, for the result: "SIGINT", say.
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
        """Waits for the end of the run; returns whether it has ended."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def result(self) -> TaskResult:
        """Returns how the run ended, or, if it has not, that it was given up while it did not stop."""
        if self._result is not None:
            return self._result
        active = ", ".join(self._recorder.active()) or "the construction of the state machine"
        return self._ended("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}, but {active} did not end in time")

    def _run(self) -> None:
        """Body of the thread."""
        try:
            with stoppable(self._stop.is_set):
                machine = self._factory()
        except Exception as error:  # a state's constructor may raise anything, which is reported to the user
            smach.logdebug(traceback.format_exc())
            if self._stop.is_set():
                self._result = self._ended("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
            else:
                text = f"the state machine could not be made: {_where_defined(error)}{type(error).__name__}: {error}"
                self._result = self._ended("not run", EXIT_NOT_RUN, text)
            return
        self._recorder.attach(machine)
        with self._lock:
            self._machine = machine
            stopped = self._stop.is_set()
        if stopped:
            self._result = self._ended("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
            return
        self._result = self._execute(machine)

    def _execute(self, machine: smach.Container) -> TaskResult:
        try:
            outcome = str(machine.execute(smach.UserData()))
        except smach.InvalidUserCodeError as error:
            return self._ended("error", EXIT_FAILED, str(error))
        except Exception as error:
            return self._ended("error", EXIT_FAILED, f"{type(error).__name__}: {error}")
        if self._stop.is_set():
            return self._ended("preempted", EXIT_FAILED, f"stopped by {self._stop_cause}")
        success = outcome == machine.get_registered_outcomes()[0]
        return self._ended(outcome, EXIT_SUCCEEDED if success else EXIT_FAILED, "")

    def _ended(self, outcome: str, exit_code: int, error: str) -> TaskResult:
        return TaskResult(self._name, outcome, exit_code, self._recorder.failures(), error)


def _where_defined(error: Exception) -> str:
    """Returns the location in the task of the state whose constructor raised, and ": "; "" where it is not known."""
    lines = [frame.line or "" for frame in traceback.extract_tb(error.__traceback__)]
    locations = [line.partition(LOCATION_MARK)[2] for line in lines if LOCATION_MARK in line]
    return f"{locations[-1]}: " if locations else ""
