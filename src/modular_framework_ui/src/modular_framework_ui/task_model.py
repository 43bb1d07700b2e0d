# SPDX-License-Identifier: BSD-3-Clause
"""State and history of a task, built from messages about the task; a page that opens late receives the whole history.

The smach topics of any state machine show which states run. `run_task` also reports the outcome and the reason of each
state of its task. The model takes the runs of these states from the reports, and the runs of machines from the smach
topics.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from modular_framework_core.task_constructor.machine_graph import MachineFrame
from modular_framework_ui.joint_history import JointHistory, Quantity
from modular_framework_ui.messages import LogLine, MachineStatus, MachineStructure, TaskReport, machine_frame
from modular_framework_ui.outcomes import machine_outcome, only_outcome
from modular_framework_ui.revised_entries import RevisedEntries
from modular_framework_ui.task_state import Phase, ReplayedRecord, StateRun, TaskChanges, TaskSummary

MAX_RUNS = 2000
MAX_LOG_LINES = 500
MAX_SAMPLES = 6000
SAMPLE_PERIOD_S = 0.1
"""Period of the samples of the joints [s]; the model keeps the samples of the last ten minutes."""
RESTART_S = 1.0
"""Minimum decrease of the elapsed time at a restart [s]; messages of two threads are out of order by less."""


class TaskModel:
    """Collects the messages about the latest task. All methods are thread-safe.

    Args:
        clock: Function that returns the time [s].
        on_change: Function called after each change.
        sample_period_s: Minimum time between two samples of the joints [s].
    """

    def __init__(
        self,
        clock: Callable[[], float],
        on_change: Callable[[], None] = lambda: None,
        *,
        sample_period_s: float = SAMPLE_PERIOD_S,
    ) -> None:
        self._clock, self._on_change = clock, on_change
        self._lock = threading.RLock()
        self._revision = 0
        self._task = TaskSummary()
        self._runs = RevisedEntries[StateRun](MAX_RUNS)
        self._log = RevisedEntries[LogLine](MAX_LOG_LINES)
        self._joints = JointHistory(MAX_SAMPLES, sample_period_s)
        self._structures: dict[str, MachineStructure] = {}
        self._statuses: dict[str, MachineStatus] = {}
        self._initial: dict[str, tuple[str, ...]] = {}
        self._last_reports: dict[str, TaskReport] = {}
        self._drawing, self._drawing_revision = "", 0
        self._viewer = ""
        self._record = ReplayedRecord()

    # ---- messages ------------------------------------------------------------------------------------------------
    def note_structure(self, structure: MachineStructure) -> None:
        """Records the structure of a container."""
        with self._lock:
            path = structure.path
            if self._structures.get(path) == structure:
                return
            self._structures[path] = structure
            for index, run in self._runs.items():
                if run.path == path:
                    self._set(index, replace(run, is_machine=True))
            enclosing = self._statuses.get(_machine_of(path))
            if enclosing is not None and self._is_running(self._root_of(path)):
                self._follow(enclosing)
            self._changed()

    def note_status(self, status: MachineStatus) -> None:
        """Records the active states of a container."""
        with self._lock:
            previous = self._statuses.get(status.path)
            if previous == status:
                return
            self._statuses[status.path], self._initial[status.path] = status, status.initial
            root, was_active = self._root_of(status.path), previous is not None and bool(previous.active)
            if status.path == root and status.active and not was_active and self._is_startable(root):
                self._start_task(root, self._clock())
                self._statuses[status.path] = status
            if self._is_running(root):
                self._follow(status)
            self._changed()

    def note_report(self, report: TaskReport) -> None:
        """Records a report of a task."""
        root = report.root
        with self._lock:
            start_s = self._clock() - report.elapsed_s
            last = self._last_reports.get(root)
            if report == last:
                return  # latched, and received again after a reconnection
            is_restarted = last is not None and report.elapsed_s < last.elapsed_s - RESTART_S
            is_first = last is None or report.event == "start"
            if is_restarted or (is_first and not self._is_running(root)):
                self._start_task(root, start_s)
            elif self._task.root != root:
                return
            elif last is None:  # smach announced the task after its start
                self._task = replace(self._task, start_s=min(start_s, self._task.start_s))
            self._last_reports[root] = report
            self._apply(report)
            self._changed()

    def note_log(self, level: str, node: str, text: str) -> None:
        """Records a line of the ROS log.

        Args:
            level: "WARN", "ERROR" or "FATAL".
            node: Name of the node.
            text: Message of the node.
        """
        with self._lock:
            self._log.add(LogLine(time_s=self._clock(), level=level, node=node, text=text), self._revision + 1)
            self._changed()

    def note_joints(self, joints: Sequence[str], values: Mapping[Quantity, Sequence[float]]) -> None:
        """Records the latest values of some joints, and samples all joints while a task runs.

        Args:
            joints: Names of the joints.
            values: Value of each joint, or nothing, by quantity.
        """
        with self._lock:
            for quantity, latest in values.items():
                self._joints.note(quantity, joints, latest)
            is_running = self._task.phase is Phase.RUNNING
            if is_running and self._joints.sample(self._clock(), self._revision + 1):
                self._changed()

    def note_lost_machine(self, path: str) -> None:
        """Records that a machine is no longer published; ends a running task without reports.

        `run_task` publishes a machine per run, so a task with reports may be in its next run.
        """
        with self._lock:
            for lost in [each for each in self._statuses if each == path or each.startswith(f"{path}/")]:
                del self._statuses[lost]
            if path not in self._last_reports:
                self._note_lost_task(path)

    def note_lost_reports(self, root: str) -> None:
        """Records the end of the node that reported a task; no effect after the end of the task."""
        with self._lock:
            self._note_lost_task(root)

    def _note_lost_task(self, root: str) -> None:
        if self._is_running(root):
            self._end_task(Phase.LOST, self._clock(), reason="The node of the task ended before the task.")
            self._changed()

    def note_drawing(self, svg: str) -> None:
        """Records the drawing of the state machine."""
        with self._lock:
            self._drawing, self._drawing_revision = svg, self._revision + 1
            self._changed()

    def note_viewer(self, address: str) -> None:
        """Records the address of the page that shows the world; "" without a viewer."""
        with self._lock:
            self._viewer = address
            self._changed()

    def note_record(self, record: ReplayedRecord) -> None:
        """Records that the messages come from a record."""
        with self._lock:
            self._record = record
            self._changed()

    # ---- state ---------------------------------------------------------------------------------------------------
    def frame(self) -> MachineFrame | None:
        """Returns the state machine of the task for drawing; None before its structure is known."""
        with self._lock:
            if self._task.root not in self._structures:
                return None
            return machine_frame(self._task.root, self._structures, self._initial)

    def changes_since(self, revision: int) -> TaskChanges:
        """Returns the changes after a revision; revision 0 returns the whole state."""
        with self._lock:
            return TaskChanges(
                revision=self._revision,
                now_s=self._clock(),
                task=self._task,
                drawing=self._drawing if self._drawing_revision > revision else None,
                viewer=self._viewer,
                runs=self._runs.changed_since(revision),
                oldest_run=self._runs.oldest,
                log=self._log.changed_since(revision),
                oldest_line=self._log.oldest,
                joints=self._joints.joints,
                samples=self._joints.sampled_since(revision),
                oldest_sample=self._joints.oldest,
                record=self._record,
            )

    def _changed(self) -> None:
        self._revision += 1
        self._on_change()

    # ---- tasks and runs ------------------------------------------------------------------------------------------
    def _root_of(self, path: str) -> str:
        """Returns the path of the outermost known machine that contains a path."""
        around = [each for each in self._structures if path == each or path.startswith(f"{each}/")]
        return min(around, key=len, default=path)

    def _is_running(self, root: str) -> bool:
        return self._task.root == root and self._task.phase is Phase.RUNNING

    def _is_startable(self, root: str) -> bool:
        """Returns whether a smach status may start a task: False for a task with reports, or during another task."""
        return root not in self._last_reports and self._task.phase is not Phase.RUNNING

    def _start_task(self, root: str, start_s: float) -> None:
        if root != self._task.root:
            self._drawing, self._drawing_revision = "", self._revision + 1
        self._task = TaskSummary(number=self._task.number + 1, root=root, phase=Phase.RUNNING, start_s=start_s)
        self._runs.clear()
        self._joints.clear()
        for stale in [each for each in self._statuses if self._root_of(each) == root]:
            del self._statuses[stale]

    def _end_task(self, phase: Phase, end_s: float, outcome: str = "", reason: str = "") -> None:
        for index, run in self._runs.items():
            if run.end_s is None:
                self._set(index, self._with_machine_outcome(replace(run, end_s=end_s)))
        self._task = replace(self._task, phase=phase, end_s=end_s, outcome=outcome, reason=reason, feedback={})

    def _set(self, index: int, run: StateRun) -> None:
        self._runs.set(index, run, self._revision + 1)

    def _last_run(self, path: str) -> tuple[int, StateRun] | None:
        """Returns the last run of a state with its index."""
        return next(((index, run) for index, run in self._runs.newest_first() if run.path == path), None)

    def _open(self, path: str, start_s: float, inputs: Mapping[str, str] | None = None) -> None:
        """Starts a run of a state, unless the state already runs."""
        last = self._last_run(path)
        if last is None or last[1].end_s is not None:
            run = StateRun(path=path, start_s=start_s, is_machine=path in self._structures, inputs=inputs or {})
            self._runs.add(run, self._revision + 1)

    def _describe(self, path: str, report: TaskReport) -> None:
        """Adds location and inputs to the last run of a state; only the state's own reports contain them."""
        last = self._last_run(path)
        if last is not None and not last[1].location and not last[1].inputs:
            described = replace(last[1], location=report.location, inputs=report.inputs)
            if described != last[1]:
                self._set(last[0], described)

    def _with_machine_outcome(self, run: StateRun) -> StateRun:
        """Returns the ended run of a machine with its outcome; "" unless the last state determines the outcome."""
        structure = self._structures.get(run.path)
        if structure is None or run.outcome:
            return run
        last = next((each for _, each in self._runs.newest_first() if _machine_of(each.path) == run.path), None)
        outcome = machine_outcome(structure, _label_of(last.path), last.outcome) if last is not None else ""
        return _with_outcome(run, outcome, structure)

    # ---- smach ---------------------------------------------------------------------------------------------------
    def _follow(self, status: MachineStatus) -> None:
        """Starts and ends the runs of a container's states."""
        now_s = self._clock()
        active = [f"{status.path}/{label}" for label in status.active]
        for index, run in self._runs.items():
            is_child = _machine_of(run.path) == status.path
            if is_child and run.end_s is None and run.path not in active and self._is_followed(run.path):
                self._set(index, self._ended_by_smach(run, status, now_s))
        userdata = {} if self._task.root in self._last_reports else status.userdata
        for path in active:
            if self._is_followed(path):
                self._open(path, now_s, userdata)
        if status.path == self._task.root and not status.active and self._task.root not in self._last_reports:
            self._end_without_report(now_s)

    def _is_followed(self, path: str) -> bool:
        """Returns whether smach determines the runs of a state: True for machines, and in tasks without reports."""
        return self._task.root not in self._last_reports or path in self._structures

    def _ended_by_smach(self, run: StateRun, status: MachineStatus, end_s: float) -> StateRun:
        ended = self._with_machine_outcome(replace(run, end_s=end_s))
        enclosing = self._structures.get(status.path)
        if ended.outcome or enclosing is None:
            return ended
        outcome = only_outcome(enclosing, _label_of(run.path), status.active)
        return _with_outcome(ended, outcome, self._structures.get(run.path))

    def _end_without_report(self, now_s: float) -> None:
        """Ends a task without reports."""
        machine = StateRun(path=self._task.root, start_s=self._task.start_s, end_s=now_s)
        structure, outcome = self._structures.get(self._task.root), self._with_machine_outcome(machine).outcome
        phases: dict[str, Phase] = {}
        if structure is not None and len(structure.outcomes) > 1:
            phases = {structure.outcomes[-1]: Phase.FAILED, structure.outcomes[0]: Phase.SUCCEEDED}
        self._end_task(phases.get(outcome, Phase.ENDED), now_s, outcome)

    # ---- reports -------------------------------------------------------------------------------------------------
    def _apply(self, report: TaskReport) -> None:
        root, time_s = self._task.root, self._task.start_s + report.elapsed_s
        if report.event == "task_end":
            phase = Phase.SUCCEEDED if report.succeeded else Phase.FAILED
            self._end_task(phase, time_s, report.outcome, report.reason)
            return
        if self._task.phase is not Phase.RUNNING and self._task.phase is not Phase.LOST:
            return  # a state that ended after the end of its task
        self._task = replace(self._task, phase=Phase.RUNNING, end_s=None, reason="")
        if report.event == "end":
            self._open(f"{root}/{report.state}", time_s - report.state_elapsed_s)
            self._close(f"{root}/{report.state}", time_s, report)
        for state in report.active:
            elapsed_s = report.state_elapsed_s if state == report.state else 0.0
            self._open(f"{root}/{state}", time_s - elapsed_s)
        self._describe(f"{root}/{report.state}", report)
        feedback = {f"{root}/{state}": activity for state, activity in report.feedback.items()}
        self._task = replace(self._task, feedback=feedback)

    def _close(self, path: str, end_s: float, report: TaskReport) -> None:
        last = self._last_run(path)
        if last is None:
            return
        has_failed = bool(report.reason)  # a state that fails always has a reason
        ended = replace(last[1], end_s=end_s, outcome=report.outcome, reason=report.reason, has_failed=has_failed)
        self._set(last[0], replace(ended, outputs=report.outputs))
        machine = self._last_run(_machine_of(path))
        if machine is not None and machine[1].end_s is not None:  # smach was faster than the report
            self._set(machine[0], self._with_machine_outcome(machine[1]))


def _with_outcome(run: StateRun, outcome: str, structure: MachineStructure | None) -> StateRun:
    """Returns a run with its outcome. The last declared outcome of a machine means failure; smach has no reasons."""
    has_failed = structure is not None and len(structure.outcomes) > 1 and outcome == structure.outcomes[-1]
    return replace(run, outcome=outcome, has_failed=has_failed, is_machine=structure is not None)


def _machine_of(path: str) -> str:
    return path.rpartition("/")[0]


def _label_of(path: str) -> str:
    return path.rpartition("/")[2]
