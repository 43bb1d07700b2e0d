# SPDX-License-Identifier: BSD-3-Clause
"""Messages about a task as dataclasses without ROS: smach machines, task reports and log lines."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from modular_framework_core.task_constructor.machine_graph import MachineFrame, StateBox, Transition


class ReportError(ValueError):
    """The text of a task report is invalid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineStructure:
    """States and transitions of a smach container.

    Attributes:
        path: Path of the container, such as "/task/Pick".
        children: Labels of the container's states, in order.
        transitions: Transitions of a state machine, or entries of the outcome map of a concurrence.
        outcomes: Outcomes of the container; the last outcome means failure.
    """

    path: str
    children: tuple[str, ...]
    transitions: tuple[Transition, ...]
    outcomes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineStatus:
    """Active states of a smach container.

    Attributes:
        path: Path of the container.
        initial: Labels of the initial states; a concurrence has several initial states.
        active: Labels of the running states; empty if the container does not run.
        userdata: Text of each userdata value; no part of a comparison.
    """

    path: str
    initial: tuple[str, ...]
    active: tuple[str, ...]
    userdata: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskReport:
    """Message of the topic `task_status`.

    Attributes:
        task: Name of the task.
        event: "start" or "end" of a state, "running", or "task_end".
        state: Path of the state, relative to the task; "" at the end of the task.
        active: Paths of the running states.
        elapsed_s: Time since the start of the task [s].
        state_elapsed_s: Time since the start of the state [s].
        outcome: Outcome of the state or of the task; "" while running or after an exception.
        reason: Reason of a failure; "" without a failure.
        succeeded: Whether the task succeeded; False before the end of the task.
        feedback: Current activities, keyed by state path.
        location: Position of the state's definition in the task, as "file:line:column"; "" if unknown.
        inputs: Text of each userdata value that the state read at its start.
        outputs: Text of each userdata value that the state wrote; empty before its end.
    """

    task: str
    event: str
    state: str
    active: tuple[str, ...]
    elapsed_s: float
    state_elapsed_s: float = 0.0
    outcome: str = ""
    reason: str = ""
    succeeded: bool = False
    feedback: dict[str, str] = field(default_factory=dict)
    location: str = ""
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)

    @property
    def root(self) -> str:
        """Returns the path of the task's machine."""
        return f"/{self.task.replace('/', '_')}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLine:
    """A line of the ROS log.

    Attributes:
        time_s: Time of arrival [s].
        level: "WARN", "ERROR" or "FATAL".
        node: Name of the node.
        text: Message of the node.
    """

    time_s: float
    level: str
    node: str
    text: str


def read_report(text: str) -> TaskReport:
    """Returns a task report.

    Args:
        text: JSON text of the topic `task_status`.

    Raises:
        ReportError: The text is not JSON, or a field is missing or has a wrong type.
    """
    try:
        values: dict[str, Any] = json.loads(text)
        return TaskReport(
            task=str(values["task"]),
            event=str(values["event"]),
            state=str(values["state"]),
            active=tuple(map(str, values["active"])),
            elapsed_s=float(values["elapsed_s"]),
            state_elapsed_s=float(values.get("state_elapsed_s", 0.0)),
            outcome=str(values.get("outcome") or ""),
            reason=str(values.get("reason") or ""),
            succeeded=bool(values.get("succeeded", False)),
            feedback=_read_texts(values, "feedback"),
            location=str(values.get("location") or ""),
            inputs=_read_texts(values, "inputs"),
            outputs=_read_texts(values, "outputs"),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ReportError(
            f"task_status: invalid report '{text[:80]}' ({type(error).__name__}: {error}); allowed: JSON with "
            "task, event, state, active and elapsed_s, as run_task publishes"
        ) from error


def _read_texts(values: dict[str, Any], key: str) -> dict[str, str]:
    return {str(name): str(text) for name, text in values.get(key, {}).items()}


def machine_frame(
    root: str, structures: dict[str, MachineStructure], initial: dict[str, tuple[str, ...]]
) -> MachineFrame:
    """Returns the frame that represents a machine and its nested machines in the drawing.

    Args:
        root: Path of the machine.
        structures: Structures of the containers, keyed by container path.
        initial: Labels of the initial states, keyed by container path.
    """
    structure = structures[root]
    children: list[StateBox | MachineFrame] = []
    for label in structure.children:
        path = f"{root}/{label}"
        nested = structures.get(path)
        children.append(
            machine_frame(path, structures, initial) if nested and nested.children else StateBox(label=label)
        )
    first = tuple(label for label in initial.get(root, ()) if label in structure.children)
    return MachineFrame(
        label=root.rpartition("/")[2],
        outcomes=structure.outcomes,
        children=tuple(children),
        initial=first or structure.children[:1],
        transitions=structure.transitions,
        is_concurrent=len(first) > 1,
    )
