# SPDX-License-Identifier: BSD-3-Clause
"""Opens an experiment of a result database, or a CSV table, for a report."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.records.snapshot_parts import PartKind, parts_of
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.report_content import ReportSource
from modular_framework_benchmark.reports.run_record import CombinationSnapshots, SnapshotValues
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.results.own_table import read_table

SPAN_SUMS = ("count", "ended", "failed", "total_s", "covered_s")


@dataclass(frozen=True, slots=True)
class OpenedExperiment:
    """An experiment in an open database.

    Attributes:
        database: Open database.
        number: Identifier of the experiment in the database.
        results: Finished episodes, without spans.
    """

    database: ResultDatabase
    number: int
    results: ExperimentResults

    @property
    def label(self) -> str:
        """Returns the name of the database for messages."""
        return self.database.label

    @property
    def snapshots(self) -> SnapshotValues:
        """Returns the distinct values of each snapshot part with their numbers of episodes."""
        return self.database.snapshot_values(self.number, parts_of(PartKind.VARYING, PartKind.SETTING))

    @property
    def combinations(self) -> CombinationSnapshots:
        """Returns the values of the snapshots by combination of levels, without those that no warning needs."""
        left_out = parts_of(PartKind.VARYING, PartKind.SETTING, PartKind.NOTE, PartKind.MEASURED)
        return self.database.combination_snapshots(self.number, left_out)

    @property
    def compared_snapshots(self) -> CombinationSnapshots:
        """Returns the values in which two experiments may differ, including settings, by combination of levels."""
        return self.database.combination_snapshots(self.number, parts_of(PartKind.VARYING))

    def source(self, report_folder: Path) -> ReportSource:
        """Returns the source of a report's further data.

        Args:
            report_folder: Folder of the report.
        """
        return ReportSource(
            self.database.label,
            self.database.folder,
            report_folder,
            self.snapshots,
            self.combinations,
            self.database.span_totals(self.number),
            self.database.milestone_levels(self.number),
            lambda episodes: self.database.spans(self.number, episodes),
        )


@dataclass(frozen=True, slots=True)
class OpenedTable:
    """A CSV table of results, which has neither snapshots nor spans nor files.

    Attributes:
        path: File of the table.
        results: Episodes of the table.
    """

    path: Path
    results: ExperimentResults

    @property
    def label(self) -> str:
        """Returns the name of the table for messages."""
        return str(self.path)

    @property
    def compared_snapshots(self) -> CombinationSnapshots:
        """Returns no values."""
        return {}

    def source(self, report_folder: Path) -> ReportSource:
        """Returns the source of a report without further data.

        Args:
            report_folder: Folder of the report.
        """
        totals = pd.DataFrame(columns=["kind", "name", self.results.description.compared, *SPAN_SUMS])
        spans = self.results.spans
        return ReportSource(self.label, self.path.parent, report_folder, {}, {}, totals, {}, lambda episodes: spans)


@contextlib.contextmanager
def open_experiment(target: str, name: str | None) -> Iterator[OpenedExperiment]:
    """Opens a database read-only and loads an experiment.

    Args:
        target: Database as named by the user.
        name: Name of the experiment; None for the only experiment.

    Raises:
        ReportError: The database has several experiments and none is named, or is empty.
        ResultsError: The database is unreadable, or lacks the experiment.
    """
    with open_database(target, read_only=True) as database:
        number = find_experiment(database, name)
        yield OpenedExperiment(database, number, database.load(number, spans=False))


@contextlib.contextmanager
def open_source(target: str, name: str | None) -> Iterator[OpenedExperiment | OpenedTable]:
    """Opens a database read-only and loads an experiment, or reads a CSV table.

    Args:
        target: Database or table as named by the user.
        name: Name of the experiment; None for the only experiment.

    Raises:
        ReportError: The database has several experiments and none is named, is empty, or a table has another name.
        ResultsError: The database is unreadable, or lacks the experiment; the table has faults.
    """
    if "://" not in target and Path(target).suffix.lower() == ".csv":
        results = read_table(Path(target))
        if name not in (None, results.description.name):
            raise ReportError(f"{target} is a table; --experiment has no effect there, remove it")
        yield OpenedTable(Path(target), results)
        return
    with open_experiment(target, name) as experiment:
        yield experiment


def find_experiment(database: ResultDatabase, name: str | None) -> int:
    """Returns the identifier of an experiment.

    Args:
        database: Open database.
        name: Name of the experiment; None for the only experiment.

    Raises:
        ReportError: The database has several experiments and none is named, or is empty.
        ResultsError: The database lacks the experiment.
    """
    if name:
        return database.find(name)
    stored = database.experiments()
    if len(stored) == 1:
        return stored[0].id
    if not stored:
        raise ReportError(f"{database.label} has no experiment; run one into it first")
    names = ", ".join(item.description.name for item in stored)
    raise ReportError(f"{database.label} has {len(stored)} experiments: {names}; name an experiment with --experiment")
