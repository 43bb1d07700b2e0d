# SPDX-License-Identifier: BSD-3-Clause
"""Opens an experiment of a result database for reading."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from modular_framework_benchmark.episodes.snapshot import COLD_START, VARYING_PARTS
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.report_content import ReportSource
from modular_framework_benchmark.reports.run_record import SnapshotValues
from modular_framework_benchmark.results.database import ResultDatabase, open_database


@dataclass(frozen=True, slots=True)
class OpenedExperiment:
    """An experiment in an open database.

    Attributes:
        database: The database.
        number: Identifier of the experiment in it.
        results: Its finished episodes, without their spans.
    """

    database: ResultDatabase
    number: int
    results: ExperimentResults

    @property
    def snapshots(self) -> SnapshotValues:
        """Returns what the episodes ran with: the different values of each name, each with its number of episodes."""
        return self.database.snapshot_values(self.number, VARYING_PARTS)

    @property
    def results_by_start(self) -> ExperimentResults:
        """Returns the results with the column `cold_start`: whether an episode was the first one of its stack."""
        cold = self.database.flagged_episodes(self.number, COLD_START)
        episodes = self.results.episodes
        return replace(self.results, episodes=episodes.assign(**{COLD_START: episodes["number"].isin(cold)}))

    def source(self, report_folder: Path) -> ReportSource:
        """Returns what a report reads beside the episodes.

        Args:
            report_folder: folder of the report.
        """
        return ReportSource(
            self.database.label,
            self.database.folder,
            report_folder,
            self.snapshots,
            self.database.span_totals(self.number),
            lambda episodes: self.database.spans(self.number, episodes),
        )


@contextlib.contextmanager
def open_source(target: str, name: str | None) -> Iterator[OpenedExperiment]:
    """Opens a database read-only and loads one of its experiments.

    Args:
        target: database, as the user named it.
        name: of the experiment; None: the only one.

    Raises:
        ReportError: when it has several and none is named, or none at all.
        ResultsError: when the database cannot be read, or has no experiment of that name.
    """
    with open_database(target, read_only=True) as database:
        number = find_experiment(database, name)
        yield OpenedExperiment(database, number, database.load(number, spans=False))


def find_experiment(database: ResultDatabase, name: str | None) -> int:
    """Returns the identifier of an experiment.

    Args:
        database: an open database.
        name: of the experiment; None: the only one.

    Raises:
        ReportError: when it has several and none is named, or none at all.
        ResultsError: when it has no experiment of that name.
    """
    if name:
        return database.find(name)
    stored = database.experiments()
    if len(stored) == 1:
        return stored[0].id
    if not stored:
        raise ReportError(f"{database.label} has no experiment; run one into it first")
    names = ", ".join(item.description.name for item in stored)
    raise ReportError(f"{database.label} has {len(stored)} experiments: {names}; name one with --experiment")
