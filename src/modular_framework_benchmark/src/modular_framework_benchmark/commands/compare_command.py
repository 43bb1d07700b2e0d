# SPDX-License-Identifier: BSD-3-Clause
"""Command `compare`: finds changes between two experiments."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_benchmark.commands.reporting import run_reporting, write_file
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.regression import Change, compare_experiments
from modular_framework_benchmark.reports.regression_page import regression_page, regression_text
from modular_framework_benchmark.reports.report_source import open_source
from modular_framework_benchmark.reports.run_record import content_differences, differences_of

EXIT_REGRESSED = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Compares two experiments; returns 0, 1 for a regression with --fail-on-regression, 2 for an error."""
    return run_reporting(_parser(), arguments, _compare)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="compare",
        description="Finds improvements and regressions between two experiments with the same factors. Episodes with "
        "the same method, levels, trial and seed are compared in pairs.",
        epilog="Exit code: 0; 1 with --fail-on-regression after a regression; 2 if the experiments are not comparable.",
    )
    parser.add_argument(
        "before", help="results of the earlier experiment: a database (a file, or a URL of SQLAlchemy), or a CSV table"
    )
    parser.add_argument("after", nargs="?", help="results of the later experiment; default: the same database")
    parser.add_argument("--experiment", metavar="NAME", help="earlier experiment, if its database has several")
    parser.add_argument("--with", dest="other", metavar="NAME", help="later experiment; default: the same name")
    parser.add_argument("--into", type=Path, metavar="FILE", help="also write an HTML page")
    parser.add_argument("--fail-on-regression", action="store_true", help="exit with code 1 after a regression")
    return parser


def _compare(arguments: argparse.Namespace) -> int:
    if arguments.after is None and not (
        arguments.experiment and arguments.other and arguments.experiment != arguments.other
    ):
        raise ReportError("a single database needs two experiments; add --experiment NAME --with NAME")
    with (
        open_source(arguments.before, arguments.experiment) as before,
        open_source(arguments.after or arguments.before, arguments.other or arguments.experiment) as after,
    ):
        differing = (
            *differences_of(before.compared_snapshots, after.compared_snapshots),
            *content_differences(before.results, after.results),
        )
        regression = dataclasses.replace(compare_experiments(before.results, after.results), differing=differing)
        print(regression_text(regression), end="")
        if arguments.into is not None:
            write_file(arguments.into, regression_page(regression, before.label, after.label).encode())
            print(f"compare: wrote {arguments.into}", file=sys.stderr)
    return EXIT_REGRESSED if arguments.fail_on_regression and regression.count(Change.WORSE) else 0
