# SPDX-License-Identifier: BSD-3-Clause
"""Execution settings of an experiment: workers and stopping rule."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from modular_framework_benchmark.experiments.experiment import Experiment, Stopping, StoppingKind
from modular_framework_benchmark.experiments.experiment_file import read_run_settings
from modular_framework_benchmark.records.experiment import ExperimentDescription

if TYPE_CHECKING:
    from modular_framework_benchmark.statistics.stopping import StoppingRule


@dataclass(frozen=True, slots=True)
class RunSettings:
    """Execution settings of an experiment, which do not determine its episodes."""

    workers: int
    stopping: Stopping


def run_settings_of(experiment: Experiment | None, description: ExperimentDescription) -> RunSettings:
    """Returns the settings of an experiment, or of its text in the database."""
    if experiment is not None:
        return RunSettings(experiment.workers, experiment.stopping)
    return RunSettings(*read_run_settings(description.text, description.metrics))


def stopping_rule(stopping: Stopping) -> StoppingRule | None:
    """Returns the stopping rule of an experiment, or None for a fixed number of trials."""
    match stopping.kind:
        case StoppingKind.FIXED:
            return None
        case StoppingKind.SEQUENTIAL:
            # Imported here, because the statistics are slow to import.
            from modular_framework_benchmark.statistics.stopping import AnytimeValid

            return AnytimeValid(stopping.metric, stopping.smallest_difference)
