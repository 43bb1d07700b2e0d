# SPDX-License-Identifier: BSD-3-Clause
"""Reads the finished episodes of an experiment into tables, column by column."""

from __future__ import annotations

import json
from collections.abc import Collection
from typing import Any

import pandas as pd
from sqlalchemy import Connection, Select, case, column, func, select, table

from modular_framework_benchmark.experiments.modes import MODES, stored_settings
from modular_framework_benchmark.records.column_names import SUCCESS
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.results import COLD_START, FAILURE_CLASS, WORKER_COUNT, ExperimentResults
from modular_framework_benchmark.results.finished_episodes import STATUS_VALUES
from modular_framework_benchmark.results.schema import EPISODES, RECORDS, RUNS, SNAPSHOT_VALUES, SPANS

SPAN_COLUMNS = ("number", "kind", "name", "started_s", "ended_s", "outcome", "failed", "reason")


def load_results(
    connection: Connection, number: int, description: ExperimentDescription, *, spans: bool = True
) -> ExperimentResults:
    """Returns the finished episodes of an experiment.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        description: Description of the experiment.
        spans: Whether to read the spans; otherwise their table is empty.
    """
    planned = connection.execute(select(func.count()).where(EPISODES.c.descriptionid == number)).scalar_one()
    episodes = load_episodes(connection, number, description)
    return ExperimentResults(description, episodes, load_spans(connection, number, None if spans else ()), planned)


def load_episodes(connection: Connection, number: int, description: ExperimentDescription) -> pd.DataFrame:
    """Returns the table of episodes that `ExperimentResults` describes.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        description: Description of the experiment.
    """
    metrics = [metric.name for metric in description.metrics if metric.name != SUCCESS]
    runs = table(RUNS.name, *map(column, [*RUNS.columns.keys(), *metrics]))
    planned = EPISODES.c
    statement = (
        select(planned.number, planned.trial, planned.seed)
        .add_columns(runs.c.status, runs.c.success, RECORDS.c.outcome, RECORDS.c.cause, RECORDS.c.begun)
        .add_columns(runs.c.wall_s, runs.c.simulated_s, RECORDS.c.folder, RECORDS.c.worker)
        .add_columns(planned.configuration, *(runs.c[name] for name in metrics))
        .join_from(EPISODES, runs, runs.c.id == planned.id)
        .join(RECORDS, RECORDS.c.runid == planned.id)
        .where(planned.descriptionid == number)
        .order_by(planned.number)
    )
    mode = MODES.get(description.mode)
    if mode is not None and "problems" in mode.keys:
        statement = statement.add_columns(planned.settings)
    columns = _read_columns(connection, statement)
    names = {value: status.value for status, value in STATUS_VALUES.items()}
    frame = {name: pd.Series(columns[name], dtype="int64") for name in ("number", "trial", "seed")}
    frame["status"] = pd.Series([names[value] for value in columns["status"]], dtype="str")
    frame["success"] = pd.Series(columns["success"], dtype="bool")
    frame |= {name: pd.Series(columns[name], dtype="str") for name in ("outcome", "cause")}
    frame |= {name: pd.Series(columns[name], dtype="float64") for name in ("begun", "wall_s", "simulated_s")}
    frame |= {name: pd.Series(columns[name], dtype="str") for name in ("folder", "worker")}
    frame |= _levels(columns["configuration"], description)
    frame |= {name: pd.Series(columns[name], dtype="float64") for name in metrics}
    if "settings" in columns:
        problems = [stored_settings(description.mode, json.loads(text)).drawn_problem for text in columns["settings"]]
        frame["drawn_problem"] = pd.Series(problems, dtype="str")
    frame[COLD_START] = frame["number"].isin(_snapshot_parts(connection, number, COLD_START))
    workers = _snapshot_parts(connection, number, WORKER_COUNT)
    frame[WORKER_COUNT] = pd.Series([workers.get(each, 0) for each in columns["number"]], dtype="int64")
    failures = _snapshot_parts(connection, number, FAILURE_CLASS)
    frame[FAILURE_CLASS] = pd.Series([failures.get(each, "") for each in columns["number"]], dtype="str")
    return pd.DataFrame(frame)


def load_spans(connection: Connection, number: int, numbers: Collection[int] | None = None) -> pd.DataFrame:
    """Returns the table of spans that `ExperimentResults` describes.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        numbers: Numbers of the episodes whose spans are read; None for all.
    """
    statement = (
        select(EPISODES.c.number, *(SPANS.c[name] for name in SPAN_COLUMNS[1:]))
        .join_from(EPISODES, SPANS, SPANS.c.runid == EPISODES.c.id)
        .where(EPISODES.c.descriptionid == number)
        .order_by(EPISODES.c.number, SPANS.c.place)
    )
    if numbers is not None:
        statement = statement.where(EPISODES.c.number.in_(sorted(numbers)))
    columns = _read_columns(connection, statement)
    kinds = {"number": "int64", "started_s": "float64", "ended_s": "float64", "failed": "bool"}
    return pd.DataFrame({name: pd.Series(columns[name], dtype=kinds.get(name, "str")) for name in SPAN_COLUMNS})


def span_totals(connection: Connection, number: int, description: ExperimentDescription) -> pd.DataFrame:
    """Returns sums over the spans, computed in the database because spans can be too many to read.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        description: Description of the experiment.

    Returns:
        A row per kind, name and method with the columns `kind`, `name`, the compared factor's name, `count`,
        `ended` (number of ended spans), `failed`, `total_s` (sum of the durations of ended spans) and `covered_s`
        (time with at least one span running: overlapping spans of an episode count once).
    """
    one_kind = (SPANS.c.runid, SPANS.c.kind, SPANS.c.name)
    order = (SPANS.c.started_s, SPANS.c.place)
    before_s = func.max(SPANS.c.ended_s).over(partition_by=one_kind, order_by=order, rows=(None, -1))
    alone_s = SPANS.c.ended_s - case((before_s > SPANS.c.started_s, before_s), else_=SPANS.c.started_s)
    spans = (
        select(SPANS.c.kind, SPANS.c.name, SPANS.c.started_s, SPANS.c.ended_s, SPANS.c.failed, EPISODES.c.configuration)
        .add_columns(case((alone_s > 0.0, alone_s), else_=0.0).label("alone_s"))
        .join_from(EPISODES, SPANS, SPANS.c.runid == EPISODES.c.id)
        .where(EPISODES.c.descriptionid == number)
        .subquery()
    )
    statement = (
        select(spans.c.kind, spans.c.name, spans.c.configuration)
        .add_columns(func.count().label("count"), func.count(spans.c.ended_s).label("ended"))
        .add_columns(func.count().filter(spans.c.failed).label("failed"))
        .add_columns(func.sum(spans.c.ended_s - spans.c.started_s).label("total_s"))  # unended spans have no duration
        .add_columns(func.sum(spans.c.alone_s).label("covered_s"))
        .group_by(spans.c.kind, spans.c.name, spans.c.configuration)
    )
    columns = _read_columns(connection, statement)
    columns[description.compared] = [json.loads(each)[description.compared] for each in columns.pop("configuration")]
    names = ["kind", "name", description.compared]
    sums = pd.DataFrame(columns).fillna({"total_s": 0.0})
    sums = sums.groupby(names, as_index=False, sort=True)
    return sums[["count", "ended", "failed", "total_s", "covered_s"]].sum()


def milestone_levels(connection: Connection, number: int) -> dict[str, list[dict[str, str]]]:
    """Returns the combinations of levels at which episodes have each milestone, keyed by milestone.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
    """
    rows = connection.execute(
        select(SPANS.c.name, EPISODES.c.configuration)
        .join_from(EPISODES, SPANS, SPANS.c.runid == EPISODES.c.id)
        .where(EPISODES.c.descriptionid == number, SPANS.c.kind == "milestone")
        .distinct()
    )
    levels: dict[str, list[dict[str, str]]] = {}
    for name, configuration in rows:
        levels.setdefault(name, []).append(json.loads(configuration))
    return levels


def snapshot_values(
    connection: Connection, number: int, leave_out: Collection[str] = ()
) -> dict[str, list[tuple[Any, int]]]:
    """Returns the distinct values of the episodes' snapshots.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        leave_out: Names of the parts to skip.

    Returns:
        Distinct values of each part with their numbers of episodes, most frequent first, keyed by part name.
    """
    return _values_by_combination(connection, number, leave_out, pooled=True).get("", {})


def combination_snapshots(
    connection: Connection, number: int, leave_out: Collection[str] = ()
) -> dict[str, dict[str, list[tuple[Any, int]]]]:
    """Returns the distinct values of the snapshots, as `snapshot_values`, by combination of levels: "method=a, x=1".

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        leave_out: Names of the parts to skip.
    """
    return _values_by_combination(connection, number, leave_out, pooled=False)


def _values_by_combination(
    connection: Connection, number: int, leave_out: Collection[str], *, pooled: bool
) -> dict[str, dict[str, list[tuple[Any, int]]]]:
    """Returns the distinct values of the snapshots; pooled values have the combination ""."""
    rows = connection.execute(
        select(EPISODES.c.configuration, RECORDS.c.snapshot, func.count())
        .join_from(EPISODES, RECORDS, RECORDS.c.runid == EPISODES.c.id)
        .where(EPISODES.c.descriptionid == number)
        .group_by(EPISODES.c.configuration, RECORDS.c.snapshot)
    )
    counts: dict[str, dict[int, int]] = {}
    for configuration, text, count in rows:
        of_combination = counts.setdefault("" if pooled else _combination_text(configuration), {})
        for value in json.loads(text).values():
            of_combination[value] = of_combination.get(value, 0) + count
    columns = SNAPSHOT_VALUES.c
    stored = connection.execute(
        select(columns.id, columns.name, columns.value).where(columns.name.not_in(leave_out)).order_by(columns.id)
    )
    used = set[int]().union(*counts.values())
    values = [(each.id, each.name, json.loads(each.value)) for each in stored if each.id in used]
    values_by_combination: dict[str, dict[str, list[tuple[Any, int]]]] = {}
    for combination, of_combination in sorted(counts.items()):
        parts: dict[str, list[tuple[Any, int]]] = {}
        for key, name, value in values:
            if key in of_combination:
                parts.setdefault(name, []).append((value, of_combination[key]))
        values_by_combination[combination] = {
            name: sorted(parts[name], key=lambda each: -each[1]) for name in sorted(parts)
        }
    return values_by_combination


def _combination_text(configuration: str) -> str:
    return ", ".join(f"{name}={level}" for name, level in sorted(json.loads(configuration).items()))


def _snapshot_parts(connection: Connection, number: int, name: str) -> dict[int, Any]:
    """Returns a part of the episodes' snapshots, keyed by the number of the episode; episodes without it are left out.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        name: Name of the part.
    """
    columns = SNAPSHOT_VALUES.c
    found = connection.execute(select(columns.id, columns.value).where(columns.name == name))
    values = {row.id: json.loads(row.value) for row in found}
    if not values:
        return {}
    rows = connection.execute(
        select(EPISODES.c.number, RECORDS.c.snapshot)
        .join_from(EPISODES, RECORDS, RECORDS.c.runid == EPISODES.c.id)
        .where(EPISODES.c.descriptionid == number)
    )
    parts = {row.number: json.loads(row.snapshot).get(name) for row in rows}
    return {episode: values[part] for episode, part in parts.items() if part in values}


def _read_columns(connection: Connection, statement: Select[Any]) -> dict[str, Any]:
    result = connection.execute(statement)
    names = list(result.keys())
    rows = result.all()
    return dict(zip(names, zip(*rows, strict=True) if rows else [()] * len(names), strict=True))


def _levels(configurations: tuple[str, ...], description: ExperimentDescription) -> dict[str, Any]:
    levels_of_text = {text: json.loads(text) for text in set(configurations)}
    return {
        factor.name: pd.Series([levels_of_text[text][factor.name] for text in configurations], dtype="str")
        for factor in description.factors
    }
