# SPDX-License-Identifier: BSD-3-Clause
"""An experiment that was read from a file and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from modular_framework_benchmark.records.experiment import ExperimentDescription


class StoppingKind(Enum):
    """When an experiment ends."""

    FIXED = "fixed"  # after all trials
    SEQUENTIAL = "sequential"  # as soon as the methods are told apart, or after all trials


@dataclass(frozen=True, slots=True)
class Stopping:
    """When an experiment ends.

    Attributes:
        kind: The rule.
        metric: Name of the metric that a sequential rule looks at.
        smallest_difference: Win difference below which the methods count as alike, from 0 to 1, for a rate the
            difference of the rates; None: it stops for a shown difference only.
    """

    kind: StoppingKind = StoppingKind.FIXED
    metric: str = "success"
    smallest_difference: float | None = None


@dataclass(frozen=True, slots=True)
class Combination:
    """One level of each factor, and what they set together.

    Attributes:
        configuration: Level of each factor, by its name.
        settings: Keys of the mode; numbers of a scene are `Distribution`s still.
    """

    configuration: Mapping[str, str]
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment and how it is run.

    Attributes:
        description: What the result database keeps of it; the digest is still empty.
        combinations: What is run in each trial.
        trials: How many trials there are, at most with a sequential rule.
        seed: What scenes and seeds are made from.
        block: Trials between two changes of the method, at the least.
        measures: The metrics as the episodes need them: a name, or {function: absolute FILE.py:NAME, ...} of a user.
        stopping: When it ends.
        workers: How many episodes run at the same time.
        record: Which files an episode keeps: `log`, `trajectories`, `bag`, `video`.
        files: SHA-256 of each file beside it that decides the episodes, by what names it.
        substitutions: What will run in place of what is named where requests need it, known beforehand.
    """

    description: ExperimentDescription
    combinations: tuple[Combination, ...]
    trials: int
    seed: int
    block: int
    measures: tuple[Any, ...]
    stopping: Stopping
    workers: int
    record: Mapping[str, bool]
    files: Mapping[str, str]
    substitutions: tuple[str, ...] = ()

    def described(self, digest: str, ran_with: Mapping[str, str]) -> ExperimentDescription:
        """Returns what the result database keeps of it.

        Args:
            digest: Of what decides its episodes.
            ran_with: Digests of what they run with, see `run_digests`.
        """
        return replace(self.description, digest=digest, ran_with={**self.files, **ran_with})
