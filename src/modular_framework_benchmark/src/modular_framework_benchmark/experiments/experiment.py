# SPDX-License-Identifier: BSD-3-Clause
"""A checked experiment and its execution settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from modular_framework_benchmark.experiments.problem_sets import Problem
from modular_framework_benchmark.experiments.scene_objects import SceneObject
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, MetricSpec, RecordedFiles
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
class RunSettings:
    """Execution settings of an experiment, which do not determine its episodes."""

    workers: int
    stopping: Stopping


@dataclass(frozen=True, slots=True)
class Combination:
    """A combination of one level per factor, with the resulting settings.

    Attributes:
        configuration: Level of each factor, keyed by factor name.
        settings: Settings without scene and problem, which each trial draws.
        objects: Objects that each trial places.
        problems: Planning problems; each trial has one problem.
    """

    configuration: Mapping[str, str]
    settings: EpisodeSettings
    objects: tuple[SceneObject, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def files(self) -> list[Path]:
        """Returns the files whose content determines the episodes."""
        problems = [Path(file) for problem in self.problems for file in (problem.scene, problem.request)]
        return [*(item.file for item in self.objects), *self.settings.files, *problems]


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment and its execution settings.

    Attributes:
        description: Description for the result database, without digest.
        combinations: Combinations that each trial runs.
        trials: Number of trials; an upper limit for a sequential rule.
        seed: Seed of the scenes and of the episodes' seeds.
        block: Minimum number of trials between two changes of the method.
        metric_specs: Metrics as the episodes need them: names of metrics of the framework, and the user's metrics.
        stopping: Stopping rule.
        workers: Number of episodes that run in parallel.
        record: Files that an episode keeps.
        files: SHA-256 digests of the other files that determine the episodes, keyed by portable file name.
        substitutions: Substitutions of named planners and solvers, known in advance.
    """

    description: ExperimentDescription
    combinations: tuple[Combination, ...]
    trials: int
    seed: int
    block: int
    metric_specs: tuple[MetricSpec, ...]
    stopping: Stopping
    workers: int
    record: RecordedFiles
    files: Mapping[str, str]
    substitutions: tuple[str, ...] = ()

    def describe(self, digest: str, ran_with: Mapping[str, str]) -> ExperimentDescription:
        """Returns the description for the result database.

        Args:
            digest: Digest of everything that determines the episodes.
            ran_with: Digests of the software and files that run, from `run_digests`.
        """
        return replace(self.description, digest=digest, ran_with=dict(ran_with))
