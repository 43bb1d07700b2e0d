# SPDX-License-Identifier: BSD-3-Clause
"""Stores the record of a finished episode exactly once, and reads it."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, fields
from typing import Any

from sqlalchemy import Connection, Row, column, insert, select, table, update

from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.records.column_names import SUCCESS
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.experiment import ExperimentDescription, MetricKind
from modular_framework_benchmark.results.columns import insert_row
from modular_framework_benchmark.results.errors import RecordRefusedError
from modular_framework_benchmark.results.json_records import to_json
from modular_framework_benchmark.results.planned_episodes import UNKNOWN_VERSION
from modular_framework_benchmark.results.schema import EPISODES, EXPERIMENTS, RECORDS, RUNS, SNAPSHOT_VALUES, SPANS

STATUS_VALUES = {status: value for value, status in enumerate(EpisodeStatus)}
"""Numbers of the statuses in the table `enums` of Planner Arena."""


def store_record(
    connection: Connection, number: int, description: ExperimentDescription, record: EpisodeRecord
) -> bool:
    """Stores the record of an episode unless the database has its record already.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        description: Description of the experiment.
        record: Record of the episode.

    Returns:
        Whether the record was stored; otherwise the existing record is kept.

    Raises:
        RecordRefusedError: The experiment lacks the episode, or a value is invalid.
    """
    episode = find_episode(connection, number, record.spec.key)
    if episode is None:
        raise RecordRefusedError(
            f"experiment {description.name!r} has no episode {record.spec.key!r}; add it with add_experiment first"
        )
    if connection.execute(select(RUNS.c.id).where(RUNS.c.id == episode.id)).one_or_none() is not None:
        return False
    run = {
        "id": episode.id,
        "experimentid": episode.experimentid,
        "plannerid": episode.plannerid,
        "status": STATUS_VALUES[record.status],
        "success": record.succeeded,
        "wall_s": float(record.wall_s),
        "simulated_s": _number(record.simulated_s),
        **metric_values(description, record),
    }
    connection.execute(insert(table(RUNS.name, *map(column, run))).values(run))
    snapshot = {name: _snapshot_value(connection, name, value) for name, value in record.snapshot.items()}
    texts = {name: getattr(record, name) for name in ("outcome", "cause", "folder", "worker")}
    connection.execute(
        insert(RECORDS).values(runid=episode.id, begun=float(record.begun), snapshot=to_json(snapshot), **texts)
    )
    if record.spans:
        connection.execute(
            insert(SPANS), [_span_row(episode.id, index, span) for index, span in enumerate(record.spans)]
        )
    _update_condition(connection, episode.experimentid, record)
    return True


def find_episode(connection: Connection, number: int, key: str) -> Row[Any] | None:
    """Returns the row of a planned episode; None for an episode that is not planned.

    Args:
        connection: Connection to the database.
        number: Identifier of the experiment.
        key: Key of the episode.
    """
    return connection.execute(
        select(EPISODES).where(EPISODES.c.descriptionid == number, EPISODES.c.key == key)
    ).one_or_none()


def metric_values(description: ExperimentDescription, record: EpisodeRecord) -> dict[str, float | bool | None]:
    """Returns the metrics of a record as stored in `runs`.

    Raises:
        RecordRefusedError: The experiment lacks a metric, or a rate is neither true nor false.
    """
    kinds = {metric.name: metric.kind for metric in description.metrics}
    unknown = sorted(set(record.metrics) - set(kinds) - {SUCCESS})
    if unknown:
        raise RecordRefusedError(
            f"episode {record.spec.key!r} has the metrics {', '.join(unknown)}, which experiment {description.name!r} "
            f"lacks; allowed: {', '.join(sorted(kinds))}; add them to the experiment"
        )
    values: dict[str, float | bool | None] = {}
    for name, value in record.metrics.items():
        if name == SUCCESS:
            continue  # stored as the status
        values[name] = _number(value)
        if kinds[name] is MetricKind.RATE and values[name] is not None:
            if values[name] not in (0.0, 1.0):
                raise RecordRefusedError(
                    f"episode {record.spec.key!r}: the rate {name!r} is {value!r}; allowed: 0, 1 or none; "
                    "make it a metric of kind value"
                )
            values[name] = bool(value)
    return values


def _number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else float(value)


def _span_row(run: int, index: int, span: Span) -> dict[str, Any]:
    """Returns the row of a span in `spans`; converts NumPy numbers to Python numbers."""
    times = {"started_s": float(span.started_s), "ended_s": _number(span.ended_s)}
    return {"runid": run, "place": index, **asdict(span), **times, "failed": bool(span.failed)}


def _snapshot_value(connection: Connection, name: str, value: Any) -> int:
    """Returns the row id of a snapshot value; episodes with equal values share a row."""
    text = to_json(value)
    digest = hashlib.sha256(text.encode()).hexdigest()
    columns = SNAPSHOT_VALUES.c
    stored_value = connection.execute(
        select(columns.id).where(columns.name == name, columns.digest == digest)
    ).scalar_one_or_none()
    if stored_value is not None:
        return int(stored_value)
    row = insert(SNAPSHOT_VALUES).values(name=name, digest=digest, value=text)
    return insert_row(connection, row)


def _update_condition(connection: Connection, experiment: int, record: EpisodeRecord) -> None:
    """Adds the episode's wall time to the experiment of Planner Arena, and sets the version if unknown."""
    columns = EXPERIMENTS.c
    row = update(EXPERIMENTS).where(columns.id == experiment)
    connection.execute(row.values(totaltime=columns.totaltime + float(record.wall_s)))
    version = record.snapshot.get("version")
    if isinstance(version, str) and version:
        connection.execute(row.where(columns.version == UNKNOWN_VERSION).values(version=version[:128]))


def read_spec(row: Row[Any], mode: str) -> EpisodeSpec:
    """Returns the planned episode of a row of `episodes`.

    Args:
        row: Row of `episodes`.
        mode: Mode of the experiment.
    """
    settings = stored_settings(mode, json.loads(row.settings))
    return EpisodeSpec(row.number, json.loads(row.configuration), row.trial, row.seed, settings)


def read_record(connection: Connection, row: Row[Any], description: ExperimentDescription) -> EpisodeRecord | None:
    """Returns the record of a planned episode, or None if the episode is not finished.

    Args:
        connection: Connection to the database.
        row: Row of `episodes`.
        description: Description of the experiment.
    """
    names = [metric.name for metric in description.metrics]
    runs = table(RUNS.name, *map(column, dict.fromkeys([*RUNS.columns.keys(), *names])))
    run = connection.execute(select(runs).where(runs.c.id == row.id)).mappings().one_or_none()
    if run is None:
        return None
    record_row = connection.execute(select(RECORDS).where(RECORDS.c.runid == row.id)).one()
    parts = (SPANS.c[item.name] for item in fields(Span))
    spans = connection.execute(select(*parts).where(SPANS.c.runid == row.id).order_by(SPANS.c.place)).mappings()
    status = next(each for each, value in STATUS_VALUES.items() if value == run["status"])
    return EpisodeRecord(
        spec=read_spec(row, description.mode),
        status=status,
        outcome=record_row.outcome,
        cause=record_row.cause,
        begun=record_row.begun,
        wall_s=run["wall_s"],
        simulated_s=run["simulated_s"],
        metrics={name: None if run[name] is None else float(run[name]) for name in names},
        spans=tuple(Span(**each) for each in spans),
        snapshot=_read_snapshot(connection, json.loads(record_row.snapshot)),
        folder=record_row.folder,
        worker=record_row.worker,
    )


def _read_snapshot(connection: Connection, numbers: dict[str, int]) -> dict[str, Any]:
    columns = SNAPSHOT_VALUES.c
    rows = connection.execute(select(columns.name, columns.value).where(columns.id.in_(numbers.values())))
    return {name: json.loads(value) for name, value in rows}
