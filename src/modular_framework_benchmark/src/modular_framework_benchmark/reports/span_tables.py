# SPDX-License-Identifier: BSD-3-Clause
"""Sums up what states and components took, by method, and picks the episodes whose timelines are shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from modular_framework_benchmark.episodes.snapshot import COLD_START
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.failure_groups import Link, episode_links
from modular_framework_benchmark.statistics.observations import methods_of

MOST_TIMELINES = 12


@dataclass(frozen=True, slots=True)
class SpanSummary:
    """What a state or component took in the episodes of a method.

    Attributes:
        kind: `state` or `component`.
        name: Of the state or component.
        method: Name of the method.
        runs: How often it ran.
        failed: How often it failed.
        unended: How often it never ended; these have no duration.
        mean_s: Mean real time of those that ended [s]; NaN without one.
        per_episode_s: Mean real time of an episode in which at least one of them ran [s].
    """

    kind: str
    name: str
    method: str
    runs: int
    failed: int
    unended: int
    mean_s: float
    per_episode_s: float


@dataclass(frozen=True, slots=True)
class ChosenEpisode:
    """An episode whose timeline is shown.

    Attributes:
        number: Of the episode.
        method: Its method.
        status: How it ended.
        started_cold: Whether its launch was started for it.
        links: To its folder and files.
    """

    number: int
    method: str
    status: EpisodeStatus
    started_cold: bool
    links: tuple[Link, ...]


def choose_episodes(
    results: ExperimentResults, database_folder: Path, report_folder: Path
) -> tuple[ChosenEpisode, ...]:
    """Returns, for each method, a success of median length and the first failure of its most frequent cause.

    At most MOST_TIMELINES episodes, those of the first methods.

    Args:
        results: The episodes.
        database_folder: Folder that the episodes' folders are relative to.
        report_folder: Folder of the report, which links are relative to.
    """
    episodes = results.episodes
    rows: list[pd.Series] = []
    for method in methods_of(results):
        of_method = episodes[episodes[results.description.compared] == method]
        success = of_method[of_method["success"].astype(bool)]
        if len(success):
            taken = success["simulated_s"].astype(float).fillna(success["wall_s"]).to_numpy()
            middle = int(np.argsort(taken, kind="stable")[(len(taken) - 1) // 2])
            rows.append(success.iloc[middle])
        failed = of_method[of_method["status"].isin([EpisodeStatus.FAILED.value, EpisodeStatus.TIMED_OUT.value])]
        if len(failed):
            rows.append(failed[failed["cause"] == failed["cause"].value_counts().index[0]].iloc[0])
    return tuple(
        ChosenEpisode(
            int(row["number"]),
            str(row[results.description.compared]),
            EpisodeStatus(str(row["status"])),
            bool(row.get(COLD_START, False)),
            episode_links(str(row["folder"] or ""), database_folder, report_folder),
        )
        for row in rows[:MOST_TIMELINES]
    )


def summarise_spans(results: ExperimentResults, totals: pd.DataFrame, shown: pd.DataFrame) -> tuple[SpanSummary, ...]:
    """Returns a summary for each state and component and method.

    Args:
        results: the episodes.
        totals: a row for each kind, name and method, with the columns `kind`, `name`, the compared factor's name,
            `count`, `ended`, `failed`, `total_s` and `covered_s`.
        shown: spans of some episodes, which give the order in which states follow each other.
    """
    methods = methods_of(results)
    episodes = results.episodes[results.description.compared].value_counts()
    order = {name: place for place, name in enumerate(dict.fromkeys(shown["name"]))}
    rows = totals.rename(columns={results.description.compared: "method"}).to_dict("records")
    summaries = [
        SpanSummary(
            str(row["kind"]),
            str(row["name"]),
            str(row["method"]),
            int(row["count"]),
            int(row["failed"]),
            int(row["count"] - row["ended"]),
            float(row["total_s"] / row["ended"]) if row["ended"] else float("nan"),
            float(row["covered_s"] / episodes[row["method"]]),
        )
        for row in rows
        if row["method"] in episodes.index
    ]
    return tuple(sorted(summaries, key=lambda item: _place(item, order, methods)))


def _place(item: SpanSummary, order: dict[str, int], methods: Sequence[str]) -> tuple[str, int, str, int]:
    return item.kind, order.get(item.name, len(order)), item.name, methods.index(item.method)
