# SPDX-License-Identifier: BSD-3-Clause
"""Reads results that other programs measured, from a CSV table with a row per episode.

The first line names the columns: `method`, `problem`, `success`, optionally `cause` (the reason of a failure), and one
column per metric, as `NAME [UNIT] lower` or `NAME [UNIT] higher`. Rows of different methods with the same problem form
pairs. Several rows with the same method and problem are repetitions; the k-th rows of two methods form a pair.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from modular_framework_benchmark.records.column_names import allowed_names_text, metric_name_faults
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.experiment import Direction, ExperimentDescription, Factor, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results.errors import ResultsError
from modular_framework_core.files.atomic_files import read_text

MODE = "table"
"""Mode of an experiment whose episodes the framework did not run."""
METHOD, PROBLEM, SUCCESS, CAUSE = "method", "problem", "success", "cause"
REQUIRED = (METHOD, PROBLEM, SUCCESS)
EXAMPLE = f"{METHOD},{PROBLEM},{SUCCESS},planning_time [s] lower"
SPAN_COLUMNS = ("number", "kind", "name", "started_s", "ended_s", "outcome", "failed", "reason")
_METRIC = re.compile(r"(?P<name>\S+)(?: \[(?P<unit>[^\]]*)\])? (?P<better>lower|higher)")
_SUCCESSES = {"1": True, "true": True, "0": False, "false": False}
_MAX_FAULTS = 10


class TableError(ResultsError):
    """A table is unreadable or has faults; the message lists them with their lines."""


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of the table; `values` are in the order of the metrics, NaN for an empty cell."""

    line: int
    method: str
    problem: str
    succeeded: bool
    cause: str
    values: tuple[float, ...]


def read_table(path: Path) -> ExperimentResults:
    """Returns the results of a CSV table, for statistics and reports.

    The name of the experiment is the file name without extension. The number of an episode is its line in the file.

    Args:
        path: CSV file in UTF-8, with commas between the columns.

    Raises:
        TableError: The file is unreadable, a column is missing or unknown, or a cell has an invalid value.
    """
    text = _read(path)
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if any(cells)]
    except csv.Error as error:
        raise TableError(f"{path}:{reader.line_num}: {error}; write a CSV file with commas") from error
    if len(lines) < 2:
        raise TableError(
            f"{path}: the table has no rows; write a first line such as '{EXAMPLE}', then a row per episode"
        )
    (_, headings), *body = lines
    metrics, faults = _read_headings(headings)
    _raise_if_any(path, faults)
    rows = [
        _read_row(line, dict(zip(headings, cells, strict=False)), metrics, len(cells), faults) for line, cells in body
    ]
    _raise_if_any(path, faults)
    description = ExperimentDescription(
        path.stem,
        MODE,
        text=text,
        digest=hashlib.sha256(text.encode()).hexdigest(),
        factors=(Factor(METHOD, tuple(dict.fromkeys(row.method for row in rows))),),
        compared=METHOD,
        metrics=tuple(metrics.values()),
        time_limit_s=math.inf,
        source=str(path),
    )
    spans = pd.DataFrame({name: pd.Series([], dtype="str") for name in SPAN_COLUMNS})
    return ExperimentResults(description, _episodes(rows, description.metrics), spans, len(rows))


def _read(path: Path) -> str:
    try:
        return read_text(path).removeprefix("\ufeff")  # spreadsheet programs write a byte order mark
    except FileNotFoundError as error:
        raise TableError(f"{path}: there is no such file; name a CSV table") from error
    except OSError as error:
        raise TableError(f"{path}: {error.strerror or error}; name a readable CSV table") from error
    except UnicodeDecodeError as error:
        raise TableError(f"{path}: is not UTF-8 ({error.reason}); save the table as CSV in UTF-8") from error


def _raise_if_any(path: Path, faults: Sequence[str]) -> None:
    if faults:
        more = [f"and {len(faults) - _MAX_FAULTS} more"] if len(faults) > _MAX_FAULTS else []
        raise TableError("\n".join([f"{path}: the table has faults", *faults[:_MAX_FAULTS], *more]))


def _read_headings(headings: Sequence[str]) -> tuple[dict[str, Metric], list[str]]:
    """Returns the metrics, keyed by heading, and the faults of the first line."""
    faults = [f"line 1: there is no column '{name}'; add the column" for name in REQUIRED if name not in headings]
    faults += [f"line 1: column '{name}' is there twice; remove one" for name, n in Counter(headings).items() if n > 1]
    metrics: dict[str, Metric] = {}
    for heading in dict.fromkeys(headings):
        match = _METRIC.fullmatch(heading)
        if match is not None:
            better = Direction(match["better"])
            metrics[heading] = Metric(match["name"], "task", MetricKind.VALUE, better, match["unit"] or "")
        elif heading not in (*REQUIRED, CAUSE):
            faults.append(
                f"line 1: column '{heading}'; allowed: {', '.join(REQUIRED)}, {CAUSE}, and metrics such as "
                "'planning_time [s] lower' or 'clearance [m] higher', which name the direction of better values"
            )
    names = metric_name_faults(list(metrics.values()))
    return metrics, faults + [f"line 1: {fault}; {allowed_names_text()}" for fault in names]


def _read_row(line: int, cells: dict[str, str], metrics: dict[str, Metric], count: int, faults: list[str]) -> _Row:
    """Returns a row; adds its faults to the list.

    Args:
        line: Line of the row in the file.
        cells: Text of each cell, keyed by heading.
        metrics: Metrics, keyed by heading.
        count: Number of cells that the row has.
        faults: Receives the faults of the row.
    """
    found = [f"no value in column '{name}'; write one" for name in (METHOD, PROBLEM) if not cells.get(name)]
    success = cells.get(SUCCESS, "")
    if success.lower() not in _SUCCESSES:
        found.append(f"column '{SUCCESS}' has '{success}'; allowed: {', '.join(_SUCCESSES)}")
    if count > len(cells):
        found.append(f"{count} cells; allowed: {len(cells)}, one per column")
    values = []
    for heading in metrics:
        try:
            values.append(float(cells.get(heading) or math.nan))
        except ValueError:
            values.append(math.inf)
        if math.isinf(values[-1]):
            found.append(f"column '{heading}' has '{cells[heading]}'; allowed: a number, or an empty cell for no value")
    faults += [f"line {line}: {fault}" for fault in found]
    succeeded = _SUCCESSES.get(success.lower(), False)
    return _Row(line, cells.get(METHOD, ""), cells.get(PROBLEM, ""), succeeded, cells.get(CAUSE, ""), tuple(values))


def _episodes(rows: Sequence[_Row], metrics: Sequence[Metric]) -> pd.DataFrame:
    """Returns the table of episodes that `ExperimentResults` describes.

    A trial is a problem with the number of its repetition. It is a digest, so that the same problems of two tables
    form pairs, whatever their order.
    """
    repetitions: Counter[tuple[str, str]] = Counter()
    trials = []
    for row in rows:
        trials.append(_trial(row.problem, repetitions[row.method, row.problem]))
        repetitions[row.method, row.problem] += 1
    status = [(EpisodeStatus.SUCCEEDED if row.succeeded else EpisodeStatus.FAILED).value for row in rows]
    causes = ["" if row.succeeded else row.cause or "failed" for row in rows]
    frame = {name: pd.Series([""] * len(rows), dtype="str") for name in ("outcome", "folder", "worker")}
    frame |= {name: pd.Series([np.nan] * len(rows), dtype="float64") for name in ("begun", "wall_s", "simulated_s")}
    frame |= {name: pd.Series(trials, dtype="int64") for name in ("trial", "seed")}
    frame["number"] = pd.Series([row.line for row in rows], dtype="int64")
    frame["success"] = pd.Series([row.succeeded for row in rows], dtype="bool")
    frame |= {name: pd.Series(texts, dtype="str") for name, texts in (("status", status), ("cause", causes))}
    frame[METHOD] = pd.Series([row.method for row in rows], dtype="str")
    frame["drawn_problem"] = pd.Series([row.problem for row in rows], dtype="str")
    for index, metric in enumerate(metrics):
        frame[metric.name] = pd.Series([row.values[index] for row in rows], dtype="float64")
    return pd.DataFrame(frame)


def _trial(problem: str, repetition: int) -> int:
    return int(hashlib.sha256(f"{problem}\0{repetition}".encode()).hexdigest()[:12], 16)
