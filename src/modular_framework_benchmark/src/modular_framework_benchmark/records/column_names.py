# SPDX-License-Identifier: BSD-3-Clause
"""Reserved names that metrics and factors must not use: the column names of every result table."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_benchmark.records.experiment import Factor, Metric, MetricKind

SUCCESS = "success"
RESULT_COLUMNS = frozenset(
    (
        "number trial seed status outcome cause begun wall_s simulated_s folder worker drawn_problem cold_start "
        "worker_count failure_class"
    ).split()
)
"""Columns of the result table of every experiment; factors and metrics must not use these names."""
ARENA_COLUMNS = frozenset({"id", "experimentid", "plannerid", "experiment", "planner", "version"})
"""Columns that Planner Arena joins to every run; metrics must not use these names."""


def metric_name_faults(metrics: Sequence[Metric]) -> list[str]:
    """Returns the fault of each metric whose name is invalid or taken."""
    faults: list[str] = []
    taken_names = set(RESULT_COLUMNS | ARENA_COLUMNS)
    for metric in metrics:
        lower = metric.name.lower()
        if not metric.name.isidentifier():
            faults.append(f"metric {metric.name!r} is not an identifier, such as planning_time")
        elif lower in taken_names:
            faults.append(f"metric {metric.name!r}: the name is taken")
        elif lower == SUCCESS and (metric.name != SUCCESS or metric.kind is not MetricKind.RATE):
            faults.append(f"metric {metric.name!r}: `success` is a rate, in lower case")
        taken_names.add(lower)
    return faults


def factor_name_faults(factors: Sequence[Factor], metrics: Sequence[Metric]) -> list[str]:
    """Returns the fault of each factor whose name is taken.

    Args:
        factors: Factors of an experiment.
        metrics: Metrics of the experiment.
    """
    names = [factor.name.lower() for factor in factors]
    taken_names = {metric.name.lower() for metric in metrics} | RESULT_COLUMNS | {SUCCESS}
    faults = [f"factor {each!r}: the name is taken" for each in names if each in taken_names]
    return faults + [f"factor {each!r} is there twice" for each in sorted(set(names)) if names.count(each) > 1]


def allowed_names_text() -> str:
    """Returns the allowed names of metrics and factors in words."""
    return (
        f"allowed: names that differ in more than case, none of {', '.join(sorted(RESULT_COLUMNS))}, and for metrics "
        f"none of {', '.join(sorted(ARENA_COLUMNS))}"
    )
