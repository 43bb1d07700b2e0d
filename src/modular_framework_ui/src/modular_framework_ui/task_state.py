# SPDX-License-Identifier: BSD-3-Clause
"""Values that the page shows: summary of the task, runs of states, log lines, and changes of these values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from modular_framework_ui.joint_history import JointSample
from modular_framework_ui.messages import LogLine


class Phase(Enum):
    """Phase of a task."""

    WAITING = "waiting"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    ENDED = "ended"
    """The task ended; the topics of the task do not state success or failure."""
    LOST = "lost"
    """The node of the task ended before the task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskSummary:
    """Summary of a task. Times are readings of the model's clock.

    Attributes:
        number: Index of the task, from 1; 0 before the first task.
        root: Path of the machine of the task; "" before the first task.
        phase: Phase of the task.
        start_s: Start time [s].
        end_s: End time [s]; None before the end.
        outcome: Outcome; "" before the end or if unknown.
        reason: Reason of a failure; "" without a failure.
        feedback: Current activities, keyed by state path.
    """

    number: int = 0
    root: str = ""
    phase: Phase = Phase.WAITING
    start_s: float = 0.0
    end_s: float | None = None
    outcome: str = ""
    reason: str = ""
    feedback: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class StateRun:
    """Execution of a state or of a nested machine.

    Attributes:
        path: Path of the state, such as "/task/Pick/Close".
        start_s: Start time [s].
        end_s: End time [s]; None while running.
        outcome: Outcome; "" while running or if unknown.
        reason: Reason of a failure; "" without a failure.
        has_failed: Whether the state failed.
        is_machine: Whether the state is a nested machine.
        location: Position of the definition in the task, as "file:line:column"; "" if unknown.
        inputs: Text of each userdata value that the state read at its start; without reports of the task, all userdata
            of the enclosing machine.
        outputs: Text of each userdata value that the state wrote.
    """

    path: str
    start_s: float
    end_s: float | None = None
    outcome: str = ""
    reason: str = ""
    has_failed: bool = False
    is_machine: bool = False
    location: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A milestone on the time line.

    Attributes:
        name: Name of the milestone.
        time_s: Time [s]; None if missed.
    """

    name: str
    time_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayedRecord:
    """Description of a replayed record.

    Attributes:
        title: Description of the episode; "" for a running task.
        omissions: What the record leaves out, as phrases.
        marks: Milestones of the episode.
    """

    title: str = ""
    omissions: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskChanges:
    """Changes since a revision of the model.

    Attributes:
        revision: Current revision.
        now_s: Current time [s].
        task: Summary of the task.
        drawing: SVG of the state machine; None if unchanged.
        viewer: Address of the page that shows the world; "" without a viewer.
        runs: Changed runs, keyed by index.
        oldest_run: Index of the oldest kept run.
        log: New log lines, keyed by index.
        oldest_line: Index of the oldest kept log line.
        joints: Names of the joints.
        samples: New samples of the joints, keyed by index.
        oldest_sample: Index of the oldest kept sample.
        record: Replayed record; without a title for a running task.
    """

    revision: int
    now_s: float
    task: TaskSummary
    drawing: str | None
    viewer: str
    runs: dict[int, StateRun]
    oldest_run: int
    log: dict[int, LogLine]
    oldest_line: int
    joints: tuple[str, ...]
    samples: dict[int, JointSample]
    oldest_sample: int
    record: ReplayedRecord
