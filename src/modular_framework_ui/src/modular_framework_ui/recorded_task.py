# SPDX-License-Identifier: BSD-3-Clause
"""Reads the record that `run_task` writes of a task."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_core.task_runner.record import MachineRecord, StateRecord

_FAR_S = 1e6
"""Time beyond each record, up to which both clocks advance equally [s]."""


class ReplayError(ValueError):
    """A record cannot be replayed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedTask:
    """Record of a task. Times of states are in seconds since the start of the task.

    Attributes:
        name: Name of the task.
        begun: Start time [s since 1970].
        outcome: Outcome of the task.
        succeeded: Whether the task ended with its success outcome.
        error: Error outside of the states' own reasons; "" without an error.
        states: Executions of states, in the order of their start.
        machines: Structures of the state machines, the root first; empty in records of earlier versions.
    """

    name: str
    begun: float
    outcome: str
    succeeded: bool
    error: str
    states: tuple[StateRecord, ...]
    machines: tuple[MachineRecord, ...]

    @property
    def ended_s(self) -> float:
        """Returns the end of the last state [s since the start of the task]."""
        return max((max(state.started_s, state.ended_s or 0.0) for state in self.states), default=0.0)

    @property
    def reason(self) -> str:
        """Returns the reasons of a failure; "" without a failure."""
        if self.succeeded:
            return ""
        failed = [f"{state.path}: {state.reason}" for state in self.states if state.failed]
        return "; ".join([*failed[-1:], *([self.error] if self.error else [])])

    def from_ros_time(self, ros_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Converts readings of the ROS clock to times since the start of the task [s].

        Both clocks are known at the start and end of each state. Between these, the conversion is linear.

        Args:
            ros_s: Readings of the ROS clock, shape (n,) [s].
        """
        known_ros, known_s = self._moments()
        return np.interp(ros_s, known_ros, known_s) if len(known_s) else np.full(np.shape(ros_s), np.nan)

    @property
    def has_ros_times(self) -> bool:
        """Returns whether readings of the ROS clock are known."""
        return len(self._moments()[0]) > 0

    def to_ros_time(self, time_s: float) -> float:
        """Converts a time since the start of the task [s] to a reading of the ROS clock [s]; NaN if unknown."""
        known_ros, known_s = self._moments()
        return float(np.interp(time_s, known_s, known_ros)) if len(known_s) else math.nan

    def to_simulated_time(self, time_s: float) -> float:
        """Converts a time since the start of the task [s] to simulated time since the start of the task [s].

        Raises:
            ReplayError: The record has no simulated times.
        """
        known_ros, known_s = self._moments()
        if not len(known_s):
            raise ReplayError(
                f"{self.name}: the record has no simulated times; allowed: records with simulated time in a pair, "
                "and any record by itself"
            )
        start, moment = np.interp([0.0, time_s], known_s, known_ros)
        return float(moment - start)

    def in_simulated_time(self) -> RecordedTask:
        """Returns the record with simulated times of its states.

        Raises:
            ReplayError: The record has no simulated times.
        """
        convert = self.to_simulated_time
        states = tuple(
            replace(
                state,
                started_s=convert(state.started_s),
                ended_s=None if state.ended_s is None else convert(state.ended_s),
            )
            for state in self.states
        )
        return replace(self, states=states)

    def _moments(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns ascending readings of the ROS clock and times since the start of the task [s]; empty if unknown."""
        moments: list[tuple[float, float]] = []
        for state in self.states:
            moments += [
                (ros, time_s)
                for ros, time_s in ((state.ros_started_s, state.started_s), (state.ros_ended_s, state.ended_s))
                if ros is not None and time_s is not None
            ]
        if not moments:
            return np.empty(0), np.empty(0)
        known_ros, known_s = np.array(sorted(moments)).T
        known_ros = np.concatenate([[known_ros[0] - _FAR_S], known_ros, [known_ros[-1] + _FAR_S]])
        known_s = np.concatenate([[known_s[0] - _FAR_S], known_s, [known_s[-1] + _FAR_S]])
        return known_ros, np.maximum.accumulate(known_s)


def read_task(path: Path) -> RecordedTask:
    """Returns the record of a task.

    Args:
        path: File that `run_task` wrote.

    Raises:
        ReplayError: The file cannot be read, or is no record of a task.
    """
    try:
        values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return RecordedTask(
            name=str(values["task"]),
            begun=float(values["begun"]),
            outcome=str(values["outcome"]),
            succeeded=bool(values["succeeded"]),
            error=str(values["error"]),
            states=tuple(StateRecord(**state) for state in values["states"]),
            machines=tuple(_machine(machine) for machine in values.get("machines", ())),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ReplayError(
            f"{path}: no record of a task ({type(error).__name__}: {error}); allowed: the folder of an episode, or a "
            "JSON file that run_task wrote into its record_directory"
        ) from error


def _machine(values: dict[str, Any]) -> MachineRecord:
    return MachineRecord(
        path=values["path"],
        children=tuple(values["children"]),
        initial=tuple(values["initial"]),
        transitions=tuple((outcome, label, target) for outcome, label, target in values["transitions"]),
        outcomes=tuple(values["outcomes"]),
    )
