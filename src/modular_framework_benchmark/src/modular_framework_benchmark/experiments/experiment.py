# SPDX-License-Identifier: BSD-3-Clause
"""A checked experiment and its execution settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from modular_framework_benchmark.records.experiment import ExperimentDescription


class StoppingKind(Enum):
    """Kind of stopping rule."""

    FIXED = "fixed"  # after all trials
    SEQUENTIAL = "sequential"  # once all comparisons are decided, at the latest after all trials


@dataclass(frozen=True, slots=True)
class Stopping:
    """Stopping rule of an experiment.

    Attributes:
        kind: Kind of rule.
        metric: Name of the metric that a sequential rule tests.
        smallest_difference: Equivalence margin as a win difference from 0 to 1, for a rate the difference of the
            rates. With None only a shown difference decides a comparison.
    """

    kind: StoppingKind = StoppingKind.FIXED
    metric: str = "success"
    smallest_difference: float | None = None


@dataclass(frozen=True, slots=True)
class Combination:
    """A combination of one level per factor, with the resulting settings.

    Attributes:
        configuration: Level of each factor, keyed by factor name.
        settings: Values of the mode's keys; numbers of a scene are `Distribution`s.
    """

    configuration: Mapping[str, str]
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment and its execution settings.

    Attributes:
        description: Description for the result database, without digest.
        combinations: Combinations that each trial runs.
        trials: Number of trials; an upper limit for a sequential rule.
        seed: Seed of the scenes and of the episodes' seeds.
        block: Minimum number of trials between two changes of the method.
        metric_specs: Metrics as the episodes need them: a name, or {function: absolute FILE.py:NAME, ...} of a user.
        stopping: Stopping rule.
        workers: Number of episodes that run in parallel.
        record: Whether an episode keeps each kind of file: `log`, `trajectories`, `bag`, `video`.
        files: SHA-256 digests of the other files that determine the episodes, keyed by portable file name.
        substitutions: Substitutions of named planners and solvers, known in advance.
    """

    description: ExperimentDescription
    combinations: tuple[Combination, ...]
    trials: int
    seed: int
    block: int
    metric_specs: tuple[Any, ...]
    stopping: Stopping
    workers: int
    record: Mapping[str, bool]
    files: Mapping[str, str]
    substitutions: tuple[str, ...] = ()

    def described(self, digest: str, ran_with: Mapping[str, str]) -> ExperimentDescription:
        """Returns the description for the result database.

        Args:
            digest: Digest of everything that determines the episodes.
            ran_with: Digests of the software that runs, from `run_digests`.
        """
        return replace(self.description, digest=digest, ran_with={**self.files, **ran_with})
