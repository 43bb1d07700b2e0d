# SPDX-License-Identifier: BSD-3-Clause
"""One episode of an experiment: what to run, and what it gave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


@dataclass(frozen=True, slots=True)
class EpisodeSpec:
    """An episode to run.

    Attributes:
        number: Its place in the order of the run, from 0; unique in an experiment.
        configuration: Level of each factor, by the factor's name.
        trial: Number of the scene and seed. Episodes of different methods with the same trial and the same levels of
            the other factors are a pair: they have the same scene and the same seeds.
        seed: What every random source of the episode is seeded with, from the experiment's seed and the trial.
        settings: What the levels stand for, merged: the keys of the mode (launch arguments, parameters, objects, ...).
    """

    number: int
    configuration: Mapping[str, str]
    trial: int
    seed: int
    settings: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Returns what identifies the episode within its experiment, whatever the order of the run is."""
        levels = ",".join(f"{name}={self.configuration[name]}" for name in sorted(self.configuration))
        return f"{levels};trial={self.trial}"


class EpisodeStatus(Enum):
    """How an episode ended."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"  # it ran to its end, without success
    TIMED_OUT = "timed_out"  # it did not end within its time limit
    BROKEN = "broken"  # the launch died or the measurement failed: says nothing of the method by itself
    INVALID = "invalid"  # what it was judged by was changed from outside: counts as a failure without any figure


@dataclass(frozen=True, slots=True)
class Span:
    """A part of an episode with a start and an end, for timelines and times by component.

    Attributes:
        kind: `state` for a state of the task, `component` for generation, planning or execution.
        name: Path of the state, or name of the component.
        started_s: Start [s since the episode began, by the clock named in `EpisodeRecord`].
        ended_s: End [s]; None if it never ended.
        outcome: Outcome of the state; "" where there is none.
        failed: Whether it failed.
        reason: Why it failed; "" when it did not.
    """

    kind: str
    name: str
    started_s: float
    ended_s: float | None
    outcome: str = ""
    failed: bool = False
    reason: str = ""


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """What an episode gave.

    Attributes:
        spec: What was run.
        status: How it ended.
        outcome: Outcome of the task; "" when it had none.
        cause: Why it did not succeed, in words; "" on success.
        begun: When it started [s since 1970].
        wall_s: How long it took, start and stop included [s].
        simulated_s: How long it took by the simulated clock [s]; None without one.
        metrics: Value of each metric by its name; None where it has none, such as the lift of an object never touched.
        spans: What its states and components did, in the order they started.
        snapshot: What it ran with: versions, machine, git revision, seeds, parameters (JSON values).
        folder: Folder with its files (log, trajectories, bag, video), relative to that of the database; "" for none.
        worker: Who ran it.
    """

    spec: EpisodeSpec
    status: EpisodeStatus
    outcome: str
    cause: str
    begun: float
    wall_s: float
    simulated_s: float | None
    metrics: Mapping[str, float | None]
    spans: tuple[Span, ...] = ()
    snapshot: Mapping[str, Any] = field(default_factory=dict)
    folder: str = ""
    worker: str = ""

    @property
    def succeeded(self) -> bool:
        """Returns whether it succeeded."""
        return self.status is EpisodeStatus.SUCCEEDED
