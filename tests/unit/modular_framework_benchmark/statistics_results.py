# SPDX-License-Identifier: BSD-3-Clause
"""Makes results of experiments for the tests of the statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from modular_framework_benchmark.records.experiment import (
    Direction,
    ExperimentDescription,
    Factor,
    Metric,
    MetricKind,
)
from modular_framework_benchmark.records.results import ExperimentResults

TIME = Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s", limit=60.0)
LENGTH = Metric("path_length", "planning", MetricKind.VALUE, Direction.LOWER, "rad")


def results_of(
    statuses: Mapping[str, Sequence[str]],
    metrics: Sequence[Metric] = (),
    values: Mapping[str, Mapping[str, Sequence[float]]] | None = None,
    *,
    objects: Sequence[str] = (),
    seed_per_pair: bool = True,
    sequential: bool = False,
    planned: int | None = None,
) -> ExperimentResults:
    """Returns the results of an experiment that compares methods.

    Args:
        statuses: Status of each episode of each method, in the order of the trials (of each object in turn).
        metrics: Metrics beside success.
        values: By metric and method, the value in each episode.
        objects: Levels of a factor `object`; the episodes are dealt out to them in turn.
        seed_per_pair: Whether pairs of one trial and several objects have seeds of their own.
        sequential: Whether a stopping rule looked at the results.
        planned: Episodes of the experiment; None: those there are.
    """
    rows: list[dict[str, object]] = []
    for method, of_method in statuses.items():
        for place, status in enumerate(of_method):
            trial, number = divmod(place, max(len(objects), 1))
            row: dict[str, object] = {
                "trial": trial, "seed": 1 + (place if seed_per_pair else trial), "status": status,
                "success": status == "succeeded", "method": method,
                "cause": "" if status == "succeeded" else f"it {status}",
            }  # fmt: skip
            if objects:
                row["object"] = objects[number]
            for metric in metrics:
                row[metric.name] = (values or {})[metric.name][method][place]
            rows.append(row)
    columns = ["trial", "seed", "status", "success", "method", "cause", *(["object"] if objects else [])]
    episodes = pd.DataFrame(rows, columns=[*columns, *(metric.name for metric in metrics)])
    episodes.insert(0, "number", np.arange(len(episodes)))
    factors = [Factor("method", tuple(statuses))]
    if objects:
        factors.append(Factor("object", tuple(objects)))
    description = ExperimentDescription(
        "test",
        "task",
        text="",
        digest="",
        factors=tuple(factors),
        compared="method",
        metrics=tuple(metrics),
        time_limit_s=60.0,
        sequential=sequential,
    )
    return ExperimentResults(description, episodes, pd.DataFrame(), len(episodes) if planned is None else planned)


def outcomes(flags: Sequence[bool] | Sequence[int] | np.ndarray) -> list[str]:
    """Returns the status of episodes that succeeded or not."""
    return ["succeeded" if flag else "failed" for flag in flags]
