# SPDX-License-Identifier: BSD-3-Clause
"""What the text of a stored experiment says about running it: its workers and its stopping rule."""

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
    """How an experiment is run, which does not decide its episodes."""

    workers: int
    stopping: Stopping


def settings_of(experiment: Experiment | None, description: ExperimentDescription) -> RunSettings:
    """Returns the settings of an experiment, or of the text that the database has of it."""
    if experiment is not None:
        return RunSettings(experiment.workers, experiment.stopping)
    return RunSettings(*read_run_settings(description.text, description.metrics))


def stopping_rule(stopping: Stopping) -> StoppingRule | None:
    """Returns the rule that decides when an experiment ends; None for one that runs all its trials."""
    match stopping.kind:
        case StoppingKind.FIXED:
            return None
        case StoppingKind.SEQUENTIAL:
            # imported where it is needed: the statistics take seconds to import
            from modular_framework_benchmark.statistics.stopping import AnytimeValid

            return AnytimeValid(stopping.metric, stopping.smallest_difference)
