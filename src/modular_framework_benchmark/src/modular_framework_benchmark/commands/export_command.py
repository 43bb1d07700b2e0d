# SPDX-License-Identifier: BSD-3-Clause
"""Command `export`: writes results for other programs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from modular_framework_benchmark.commands.reporting import database_parser, run_reporting
from modular_framework_benchmark.records.episode import EpisodeRecord
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.reports.report_source import find_experiment
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.results.errors import ExportError
from modular_framework_benchmark.results.exported_tables import TableFormat, export_tables
from modular_framework_benchmark.results.lerobot_export import DEFAULT_RATE, export_lerobot

MAX_REASONS = 5


def main(arguments: Sequence[str] | None = None) -> int:
    """Exports an experiment; returns 0, or 2 after an error."""
    return run_reporting(_parser(), arguments, _export)


def _export(arguments: argparse.Namespace) -> int:
    if arguments.lerobot is None and (arguments.rate is not None or arguments.where or arguments.succeeded):
        raise ExportError("--rate, --where and --succeeded require --lerobot; remove them, or add --lerobot FOLDER")
    with open_database(arguments.database, read_only=True) as database:
        number = find_experiment(database, arguments.experiment)
        for table_format in TableFormat:
            folder = getattr(arguments, table_format.value)
            if folder is not None:
                for path in export_tables(database.load(number), folder, table_format):
                    print(path)
        if arguments.lerobot is not None:
            _export_lerobot(database, number, arguments)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = database_parser(
        "export",
        "Writes the episodes of an experiment for other programs. Existing files are not overwritten.",
    )
    kinds = parser.add_mutually_exclusive_group(required=True)
    kinds.add_argument("--csv", type=Path, metavar="FOLDER", help="episodes and spans as CSV, description as JSON")
    kinds.add_argument("--parquet", type=Path, metavar="FOLDER", help="episodes and spans as Parquet")
    kinds.add_argument(
        "--lerobot", type=Path, metavar="FOLDER", help="recorded motions and videos for imitation learning"
    )
    learners = parser.add_argument_group("with --lerobot")
    learners.add_argument("--rate", type=int, metavar="HZ", help=f"frame rate [{DEFAULT_RATE}]")
    learners.add_argument(
        "--where", action="append", default=[], metavar="FACTOR=LEVEL", help="only episodes at this level; repeatable"
    )
    learners.add_argument("--succeeded", action="store_true", help="only successful episodes")
    return parser


def _export_lerobot(database: ResultDatabase, number: int, arguments: argparse.Namespace) -> None:
    description = next(stored.description for stored in database.experiments() if stored.id == number)
    levels = _chosen_levels(arguments.where, description)

    def chosen(record: EpisodeRecord) -> bool:
        if arguments.succeeded and not record.succeeded:
            return False
        return all(record.spec.configuration[name] == level for name, level in levels.items())

    rate = DEFAULT_RATE if arguments.rate is None else arguments.rate
    summary = export_lerobot(database, number, arguments.lerobot, frames_per_second=rate, chosen=chosen)
    print(f"{arguments.lerobot}: {summary.episodes} episodes, {summary.frames} frames at {rate} Hz")
    if summary.skipped:
        print(f"export: {len(summary.skipped)} episodes are omitted:", file=sys.stderr)
    for episode, reason in list(summary.skipped.items())[:MAX_REASONS]:
        print(f"  episode {episode}: {reason}", file=sys.stderr)


def _chosen_levels(texts: Sequence[str], description: ExperimentDescription) -> Mapping[str, str]:
    """Returns the requested levels, keyed by factor.

    Raises:
        ExportError: The experiment lacks a factor or level.
    """
    allowed = {factor.name: factor.levels for factor in description.factors}
    levels = {}
    for text in texts:
        name, _, level = text.partition("=")
        if level not in allowed.get(name, ()):
            levels_text = "; ".join(
                f"{factor}={' or '.join(factor_levels)}" for factor, factor_levels in allowed.items()
            )
            raise ExportError(f"--where {text}: the experiment has no such level; allowed: {levels_text}")
        levels[name] = level
    return levels
