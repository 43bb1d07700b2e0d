# SPDX-License-Identifier: BSD-3-Clause
"""Results of an experiment as tables for statistics, reports and exports."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from modular_framework_benchmark.records.experiment import ExperimentDescription

COLD_START = "cold_start"
"""Snapshot part and column that marks the first episode of a stack."""

WORKER_COUNT = "worker_count"
"""Snapshot part and column with the number of workers of the run on the machine of an episode."""

FAILURE_CLASS = "failure_class"
"""Snapshot part and column with the class of a failed episode."""


@dataclass(frozen=True, slots=True)
class ExperimentResults:
    """Finished episodes of an experiment.

    Attributes:
        description: Description of the experiment.
        episodes: A row per episode, ordered by number, with the columns `number`, `trial`, `seed`, `status` (value
            of `EpisodeStatus`), `success` (bool), `outcome`, `cause`, `begun`, `wall_s`, `simulated_s`, `folder`,
            `worker`, `worker_count` (int, number of workers of the run on the machine; 0 or no column if unknown); a
            column named after each factor with the labels of the levels; a column named after each metric
            (float, NaN without a value; 0 and 1 for a rate); in the mode `planning` also `drawn_problem`, a text that
            identifies the problem. `cold_start` (bool) marks the first episode of a stack; without the column, no
            episode is marked. `failure_class` is the class of a failed episode, "" in the mode `kinematics`.
        spans: A row per span, with the columns `number` (of the episode), `kind`, `name`, `started_s`, `ended_s`,
            `outcome`, `failed`, `reason`.
        planned: Total number of episodes, finished or not.
    """

    description: ExperimentDescription
    episodes: pd.DataFrame
    spans: pd.DataFrame
    planned: int
