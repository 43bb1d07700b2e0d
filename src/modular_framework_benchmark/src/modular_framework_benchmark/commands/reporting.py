# SPDX-License-Identifier: BSD-3-Clause
"""Common part of the commands that read result databases."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.results.errors import ResultsError
from modular_framework_core.files.atomic_files import write_atomically

EXIT_NOT_REPORTED = 2


def database_parser(prog: str, description: str) -> argparse.ArgumentParser:
    """Returns a parser with the arguments `database` and `--experiment`."""
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("database", help="result database: a file, or a URL of SQLAlchemy")
    parser.add_argument("--experiment", metavar="NAME", help="name of the experiment, if the database has several")
    return parser


def run_reporting(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    execute: Callable[[argparse.Namespace], int],
) -> int:
    """Runs a command; returns its exit code, or 2 after an error, which is printed after the command's name.

    Args:
        parser: Parser whose `prog` is the command's name.
        arguments: Command-line arguments; None for the arguments of the process.
        execute: Function that executes the command and returns the exit code.
    """
    options = parser.parse_args(arguments)
    try:
        return execute(options)
    except (ReportError, ResultsError) as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return EXIT_NOT_REPORTED


def write_file(path: Path, content: bytes) -> None:
    """Writes a file; an existing file is kept until the new file is complete.

    Raises:
        ReportError: The file is not writable.
    """
    try:
        write_atomically(path, content)
    except OSError as error:
        raise ReportError(f"{path}: {error.strerror}") from error
