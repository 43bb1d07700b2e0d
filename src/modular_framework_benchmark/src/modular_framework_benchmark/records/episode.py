# SPDX-License-Identifier: BSD-3-Clause
"""An episode of an experiment: its specification and its record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from enum import Enum
from typing import Any

from modular_framework_benchmark.records.episode_settings import EpisodeSettings, SettingsError, SettingsT


@dataclass(frozen=True, slots=True)
class EpisodeSpec:
    """Specification of an episode.

    Attributes:
        number: Index in the order of the run; unique in an experiment.
        configuration: Level of each factor, keyed by factor name.
        trial: Number of the scene and seed. Episodes of different methods with the same trial and the same levels of
            the other factors are a pair: they share the scene and the seeds.
        seed: Seed of all random generators of the episode, derived from the experiment's seed and the trial.
        settings: Settings of the levels, merged, with scene or problem; the class belongs to the mode.
    """

    number: int
    configuration: Mapping[str, str]
    trial: int
    seed: int
    settings: EpisodeSettings

    @property
    def key(self) -> str:
        """Returns a text that identifies the episode within its experiment, independent of the order of the run."""
        levels = ",".join(f"{name}={self.configuration[name]}" for name in sorted(self.configuration))
        return f"{levels};trial={self.trial}"

    def settings_of(self, kind: type[SettingsT]) -> SettingsT:
        """Returns the settings of a mode.

        Args:
            kind: Class of the settings.

        Raises:
            SettingsError: The episode belongs to another mode.
        """
        if isinstance(self.settings, kind):
            return self.settings
        found_type = type(self.settings).__name__
        raise SettingsError(
            f"episode {self.key!r} has {found_type}; allowed: {kind.__name__}; use the runner of its mode"
        )


class EpisodeStatus(Enum):
    """Final status of an episode."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"  # ended without success
    TIMED_OUT = "timed_out"  # exceeded the time limit
    BROKEN = "broken"  # the launch died or the measurement failed, which need not be the method's fault
    INVALID = "invalid"  # manipulated evaluation or replaced software; a failure without figures


@dataclass(frozen=True, slots=True)
class Span:
    """A part of an episode with a start and an end, for timelines and times per component.

    Attributes:
        kind: `state` for a state of the task, `component` for generation, planning or execution, `milestone`.
        name: Path of the state, or name of the component or milestone.
        started_s: Start by the wall clock [s since the start of the episode]; for a milestone, start of the task in
            simulated time [s since the start of the recording].
        ended_s: End by the same clock; None if it never ended, or the milestone was not reached.
        outcome: Outcome of the state; "" for none.
        failed: Whether the state or component failed, or the milestone was missed.
        reason: Reason for the failure; "" on success.
    """

    kind: str
    name: str
    started_s: float
    ended_s: float | None
    outcome: str = ""
    _: KW_ONLY
    failed: bool = False
    reason: str = ""


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """Record of a finished episode.

    Attributes:
        spec: Specification of the episode.
        status: Final status.
        outcome: Outcome of the task; "" for none.
        cause: Cause of a failure; "" on success.
        begun: Start time [s since 1970].
        wall_s: Real duration including start and stop of the stack [s].
        simulated_s: Simulated duration [s]; None without simulated time.
        metrics: Value of each metric, keyed by name; None without a value, such as the lift of an untouched object.
        spans: Spans of states and components in the order of their starts.
        snapshot: Environment: versions, machine, git revision, seeds, parameters (JSON values).
        folder: Folder of its files (log, trajectories, bag, video), relative to the database's folder; "" for none.
        worker: Worker that ran the episode.
    """

    spec: EpisodeSpec
    status: EpisodeStatus
    _: KW_ONLY
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
        """Returns whether the episode succeeded."""
        return self.status is EpisodeStatus.SUCCEEDED
