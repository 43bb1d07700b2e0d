# SPDX-License-Identifier: BSD-3-Clause
"""Command `report`: writes the report of an experiment."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_benchmark.commands.reporting import database_parser, run_reporting, write_file
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.html_page import report_page
from modular_framework_benchmark.reports.image_export import FORMATS, figure_image, find_browser, find_figure
from modular_framework_benchmark.reports.paper_tables import latex_table, markdown_table
from modular_framework_benchmark.reports.report_content import ReportContent, gather_content
from modular_framework_benchmark.reports.report_source import OpenedExperiment, open_source
from modular_framework_benchmark.reports.tables import answer_text, overview_table

TABLE_WRITERS = {"markdown": markdown_table, "latex": latex_table}


def main(arguments: Sequence[str] | None = None) -> int:
    """Reports an experiment; returns 0, or 2 after an error."""
    return run_reporting(_parser(), arguments, _report)


def write_page(experiment: OpenedExperiment, page: Path) -> str:
    """Writes the report page of an experiment; returns its summary as text.

    Args:
        experiment: Opened experiment.
        page: File of the page.

    Raises:
        ReportError: The file is not writable.
        ResultsError: The database is unreadable.
    """
    content = gather_content(experiment.results, experiment.source(page.absolute().parent))
    write_file(page, report_page(content, experiment.label).encode())
    return answer_text(content)


def _parser() -> argparse.ArgumentParser:
    parser = database_parser(
        "report",
        "Reports which method is better, in which metric, and with which confidence, as one HTML page. "
        "With --figure or --table only that part is written. In place of a database, a CSV table with the columns "
        "method, problem, success and 'METRIC [UNIT] lower' or '... higher' is allowed.",
    )
    parser.add_argument("--into", type=Path, metavar="FILE", help="output file; default: named after the experiment")
    parser.add_argument(
        "--figure",
        metavar="NAME[.png|.pdf]",
        help="write this figure as an image, by default PNG; 'list' prints the names of the figures",
    )
    parser.add_argument(
        "--mean-intervals",
        action="store_true",
        help="compute confidence intervals for mean differences of bounded metrics",
    )
    parser.add_argument("--table", choices=sorted(TABLE_WRITERS), help="print the table of methods for a paper")
    return parser


def _report(arguments: argparse.Namespace) -> int:
    if arguments.figure and arguments.table:
        raise ReportError("--figure and --table are both given; remove one of them")
    figure, image_format = _figure_and_format(arguments.figure or "")
    if figure and figure != "list":
        find_browser()  # fails early, before a large database is read
    with open_source(arguments.database, arguments.experiment) as experiment:
        name = experiment.results.description.name
        output = arguments.into or Path(f"{name}_{figure}.{image_format}" if figure else f"{name}.html")
        content = gather_content(
            experiment.results, experiment.source(output.absolute().parent), arguments.mean_intervals
        )
        if arguments.table:
            return _write_table(content, arguments)
        if figure == "list":
            print(*(f"{figure.name:32} {figure.title}" for figure in content.figures), sep="\n")
            return 0
        if figure:
            write_file(output, figure_image(find_figure(content.figures, figure), image_format))
        else:
            write_file(output, report_page(content, experiment.label).encode())
    print(answer_text(content))
    print(f"report: wrote {output}", file=sys.stderr)
    return 0


def _figure_and_format(text: str) -> tuple[str, str]:
    """Returns the name of a figure and the format of its image.

    Raises:
        ReportError: The format is unknown.
    """
    name, _, ending = text.partition(".")
    if ending and ending not in FORMATS:
        raise ReportError(f"--figure {text}: '{ending}' is not a format; allowed: {', '.join(FORMATS)}")
    return name, ending or FORMATS[0]


def _write_table(content: ReportContent, arguments: argparse.Namespace) -> int:
    text = TABLE_WRITERS[arguments.table](overview_table(content))
    if arguments.into is None:
        print(text, end="")
    else:
        write_file(arguments.into, text.encode())
    return 0
