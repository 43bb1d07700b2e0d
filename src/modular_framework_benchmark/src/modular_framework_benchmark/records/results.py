# SPDX-License-Identifier: BSD-3-Clause
"""The results of an experiment as tables, which statistics, reports and exports read."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from modular_framework_benchmark.records.experiment import ExperimentDescription


@dataclass(frozen=True, slots=True)
class ExperimentResults:
    """The finished episodes of an experiment.

    Attributes:
        description: What was run.
        episodes: A row for each episode, ordered by number, with the columns `number`, `trial`, `seed`, `status` (value
            of `EpisodeStatus`), `success` (bool), `outcome`, `cause`, `begun`, `wall_s`, `simulated_s`, `folder`,
            `worker`; a column for each factor, by its name, with the labels of the levels; a column for each metric, by
            its name (float, NaN where an episode has none; 0 and 1 for a rate); in the mode `planning` also
            `drawn_problem`, a text that is the same for episodes with the same problem.
        spans: A row for each span, with the columns `number` (of the episode), `kind`, `name`, `started_s`, `ended_s`,
            `outcome`, `failed`, `reason`.
        planned: How many episodes the experiment has in all, finished or not.
    """

    description: ExperimentDescription
    episodes: pd.DataFrame
    spans: pd.DataFrame
    planned: int
