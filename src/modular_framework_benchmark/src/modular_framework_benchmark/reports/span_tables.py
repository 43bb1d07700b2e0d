# SPDX-License-Identifier: BSD-3-Clause
"""Summarises the time of states and components by method, and selects episodes for timelines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.results import COLD_START, ExperimentResults
from modular_framework_benchmark.reports.failure_groups import EpisodeFiles, Link
from modular_framework_benchmark.statistics.observations import methods_of, other_factors

MAX_TIMELINES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class SpanSummary:
    """Time of a state, a component or until a milestone in the episodes of a method.

    Attributes:
        kind: `state`, `component` or `milestone`.
        name: Name of the state or component.
        method: Name of the method.
        runs: Number of runs.
        failed: Number of failed runs, or of episodes that missed the milestone.
        unended: Number of runs that never ended and have no duration.
        mean_s: Mean real time of ended runs, or mean simulated time until the milestone [s]; NaN without ended runs.
        per_episode_s: Mean real time per episode with at least one run active [s].
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
        number: Number of the episode.
        method: Method of the episode.
        status: Final status.
        started_cold: Whether the episode was the first of its stack.
        links: Links to its folder and files.
        option: Option that replays the episode; "" without a record of its task.
    """

    number: int
    method: str
    status: EpisodeStatus
    started_cold: bool
    links: tuple[Link, ...]
    option: str = ""


def choose_episodes(results: ExperimentResults, files: EpisodeFiles) -> tuple[ChosenEpisode, ...]:
    """Returns a success of median duration and the first failure of the most frequent cause for each method.

    At most MOST_TIMELINES episodes are returned, from the first methods.

    Args:
        results: Finished episodes.
        files: Files of the episodes.
    """
    episodes = results.episodes
    rows: list[pd.Series] = []
    for method in methods_of(results):
        of_method = episodes[episodes[results.description.compared] == method]
        success = of_method[of_method["success"].astype(bool)]
        if len(success):
            durations = success["simulated_s"].astype(float).fillna(success["wall_s"]).to_numpy()
            median = int(np.argsort(durations, kind="stable")[(len(durations) - 1) // 2])
            rows.append(success.iloc[median])
        failed = of_method[of_method["status"].isin([EpisodeStatus.FAILED.value, EpisodeStatus.TIMED_OUT.value])]
        if len(failed):
            rows.append(failed[failed["cause"] == failed["cause"].value_counts().index[0]].iloc[0])
    return tuple(
        ChosenEpisode(
            int(row["number"]),
            str(row[results.description.compared]),
            EpisodeStatus(str(row["status"])),
            bool(row.get(COLD_START, False)),
            files.links(int(row["number"]), str(row["folder"] or "")),
            files.episode_option(int(row["number"]), str(row["folder"] or "")),
        )
        for row in rows[:MAX_TIMELINES]
    )


def summarise_spans(
    results: ExperimentResults, totals: pd.DataFrame, shown_episodes: pd.DataFrame
) -> tuple[SpanSummary, ...]:
    """Returns a summary of each state and component for each method.

    Args:
        results: Finished episodes.
        totals: A row per kind, name and method, with the columns `kind`, `name`, the compared factor's name,
            `count`, `ended`, `failed`, `total_s` and `covered_s`.
        shown_episodes: Spans of some episodes, which define the order of the states.
    """
    methods = methods_of(results)
    episodes = results.episodes[results.description.compared].value_counts()
    order = {name: rank for rank, name in enumerate(dict.fromkeys(shown_episodes["name"]))}
    rows = totals.rename(columns={results.description.compared: "method"}).to_dict("records")
    summaries = [
        SpanSummary(
            kind=str(row["kind"]),
            name=str(row["name"]),
            method=str(row["method"]),
            runs=int(row["count"]),
            failed=int(row["failed"]),
            unended=int(row["count"] - row["ended"]),
            mean_s=float(row["total_s"] / row["ended"]) if row["ended"] else float("nan"),
            per_episode_s=float(row["covered_s"] / episodes[row["method"]]),
        )
        for row in rows
        if row["method"] in episodes.index
    ]
    return tuple(sorted(summaries, key=lambda item: _sort_key(item, order, methods)))


def milestone_episodes(
    results: ExperimentResults, levels: Mapping[str, Sequence[Mapping[str, str]]]
) -> dict[str, dict[str, int]]:
    """Returns the number of finished episodes of each method that have each milestone, keyed by method and milestone.

    An episode without a record, such as a broken episode, has the milestones of the other episodes at its levels.

    Args:
        results: Finished episodes.
        levels: Combinations of levels at which episodes have each milestone, keyed by milestone.
    """
    compared, names = results.description.compared, [factor.name for factor in other_factors(results)]
    rows = results.episodes[[compared, *names]].astype(str).itertuples(index=False, name=None)
    counts = Counter((method, others) for method, *others_of_row in rows for others in [tuple(others_of_row)])
    with_milestone = {
        milestone: {tuple(combination[name] for name in names) for combination in combinations}
        for milestone, combinations in levels.items()
    }
    return {
        method: {
            milestone: sum(counts[method, others] for others in combinations)
            for milestone, combinations in with_milestone.items()
        }
        for method in methods_of(results)
        if any(of_method == method for of_method, _ in counts)
    }


def _sort_key(item: SpanSummary, order: dict[str, int], methods: Sequence[str]) -> tuple[str, int, str, int]:
    return item.kind, order.get(item.name, len(order)), item.name, methods.index(item.method)
