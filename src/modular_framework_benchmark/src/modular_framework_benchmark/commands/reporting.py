# SPDX-License-Identifier: BSD-3-Clause
"""Runs a command that reads result databases."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.results.errors import ResultsError

NOT_REPORTED = 2


def database_parser(prog: str, description: str) -> argparse.ArgumentParser:
    """Returns a parser of a result database, `database`, and of the name of one of its experiments, `--experiment`."""
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("database", help="result database: a file, or a URL of SQLAlchemy")
    parser.add_argument("--experiment", metavar="NAME", help="which one, where the database has several")
    return parser


def run_reporting(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    work: Callable[[argparse.Namespace], int],
) -> int:
    """Runs a command; returns its exit code, or 2 after an error, which is printed behind the command's name.

    Args:
        parser: Of the arguments; its `prog` is the command's name.
        arguments: As given; None for those of the process.
        work: Does what they ask for, and returns the exit code.
    """
    given = parser.parse_args(arguments)
    try:
        return work(given)
    except (ReportError, ResultsError) as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return NOT_REPORTED
