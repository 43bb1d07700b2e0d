# SPDX-License-Identifier: BSD-3-Clause
"""Columns that an experiment adds to the tables of Planner Arena: metrics to `runs`, factors to `experiments`."""

from __future__ import annotations

import math

from sqlalchemy import Boolean, Column, Connection, Insert, String, inspect
from sqlalchemy.schema import CreateColumn

from modular_framework_benchmark.records.column_names import (
    allowed_names_text,
    factor_name_faults,
    metric_name_faults,
)
from modular_framework_benchmark.records.experiment import ExperimentDescription, Factor, Metric, MetricKind
from modular_framework_benchmark.results.errors import DescriptionError
from modular_framework_benchmark.results.schema import EXPERIMENTS, REAL_NUMBER, RUNS


def check_names(description: ExperimentDescription) -> None:
    """Checks that metrics and factors are valid column names of Planner Arena's tables and of the result table.

    Raises:
        DescriptionError: A name is invalid; the error lists all invalid names.
    """
    faults = metric_name_faults(description.metrics) + factor_name_faults(description.factors, description.metrics)
    names = [factor.name for factor in description.factors]
    if description.compared not in names:
        faults.append(f"compared factor {description.compared!r}: allowed: {', '.join(names) or 'none'}")
    if faults:
        raise DescriptionError(
            f"experiment {description.name!r} cannot be stored: {'; '.join(faults)}; {allowed_names_text()}; rename "
            "what is named here"
        )


def metric_column(metric: Metric) -> Column[bool] | Column[float]:
    """Returns the column of a metric in `runs`."""
    if metric.kind is MetricKind.RATE:
        return Column(metric.name, Boolean)
    return Column(metric.name, REAL_NUMBER)


def add_metric_columns(connection: Connection, description: ExperimentDescription) -> None:
    """Adds the missing columns of the metrics to `runs`.

    Raises:
        DescriptionError: The database has a metric of this name with a different kind.
    """
    present = {each["name"].lower(): each for each in inspect(connection).get_columns(RUNS.name)}
    for metric in description.metrics:
        old = present.get(metric.name.lower())
        if old is None:
            _add_column(connection, RUNS.name, metric_column(metric))
        elif old["name"] != metric.name or isinstance(old["type"], Boolean) is not (metric.kind is MetricKind.RATE):
            was = "a rate" if isinstance(old["type"], Boolean) else "a number"
            raise DescriptionError(
                f"experiment {description.name!r}: the metric {metric.name!r} is in this database already "
                f"as {old['name']!r}, {was}; rename the metric, or use another database"
            )


def factor_columns(connection: Connection, description: ExperimentDescription) -> dict[str, str]:
    """Adds the missing columns of the factors to `experiments`; the compared factor is in `plannerConfigs`.

    A factor whose levels are all numbers gets a numeric column, because Planner Arena compares number-like values as
    numbers. A factor whose name belongs to another column gets the suffix `_level`.

    Returns:
        Column name of each factor, keyed by factor name.
    """
    present = {each["name"].lower(): each for each in inspect(connection).get_columns(EXPERIMENTS.name)}
    taken_names = {column.name for column in EXPERIMENTS.columns} | {"experiment", "planner"}
    columns: dict[str, str] = {}
    for factor in description.factors:
        if factor.name == description.compared:
            continue
        name = factor.name
        numbers = is_numeric(factor)
        while name.lower() in taken_names or (
            name.lower() in present and isinstance(present[name.lower()]["type"], String) is numbers
        ):
            name += "_level"
        if name.lower() not in present:
            column = Column(name, REAL_NUMBER) if numbers else Column(name, String(512))
            _add_column(connection, EXPERIMENTS.name, column)
        taken_names.add(name.lower())
        columns[factor.name] = name
    return columns


def insert_row(connection: Connection, row: Insert) -> int:
    """Inserts a row and returns the primary key that the database assigns."""
    key = connection.execute(row).inserted_primary_key
    assert key is not None  # the insertion of one row returns its key
    return int(key[0])


def is_numeric(factor: Factor) -> bool:
    """Returns whether all levels of a factor are finite numbers."""
    try:
        return all(math.isfinite(float(level)) for level in factor.levels)
    except ValueError:
        return False


def _add_column(connection: Connection, table: str, column: Column[bool] | Column[float] | Column[str]) -> None:
    quoted = connection.dialect.identifier_preparer.quote(table)
    definition = CreateColumn(column).compile(dialect=connection.dialect)
    connection.exec_driver_sql(f"ALTER TABLE {quoted} ADD COLUMN {definition}")
