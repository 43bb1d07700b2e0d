# SPDX-License-Identifier: BSD-3-Clause
"""Groups the episodes that did not succeed by their cause, and finds the files of each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pandas as pd
import plotly.graph_objects as go

from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.figure_style import NamedFigure, color_of, label, stacked_bars, unique_labels
from modular_framework_benchmark.reports.number_text import counted

MOST_GROUPS = 40
MOST_EPISODES = 10
MOST_BARS = 12
MOST_FILES = 6
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")
_KINDS = {".log": "log", ".mp4": "video", ".webm": "video", ".bag": "bag"}


@dataclass(frozen=True, slots=True)
class Link:
    """A link of the report: what the reader sees, and where it leads, relative to the report and percent-encoded."""

    text: str
    target: str


@dataclass(frozen=True, slots=True)
class FailedEpisode:
    """An episode that did not succeed.

    Attributes:
        number: Of the episode.
        method: Its method.
        levels: Its levels of the other factors, in words.
        seed: Its seed.
        status: How it ended.
        cause: Why, in words.
        links: Its folder and files.
    """

    number: int
    method: str
    levels: str
    seed: int
    status: EpisodeStatus
    cause: str
    links: tuple[Link, ...]


@dataclass(frozen=True, slots=True)
class FailureGroup:
    """Episodes that failed for the same cause, numbers in it aside.

    Attributes:
        cause: The cause; numbers are replaced by `…` where episodes differ in them.
        status: How these episodes ended.
        episodes: How many they are.
        shown: The first of them.
        by_method: How many they are of each method.
    """

    cause: str
    status: EpisodeStatus
    episodes: int
    shown: tuple[FailedEpisode, ...]
    by_method: Mapping[str, int]

    @property
    def caption(self) -> str:
        """Says which of its episodes are shown."""
        every = counted(self.episodes, "episode")
        return f"All {every}." if len(self.shown) == self.episodes else f"The first {len(self.shown)} of {every}."


@dataclass(frozen=True, slots=True)
class Failures:
    """All failures of an experiment.

    Attributes:
        groups: The most frequent causes, at most MOST_GROUPS.
        causes: How many causes there are.
        episodes: How many episodes did not succeed, of all causes.
    """

    groups: tuple[FailureGroup, ...]
    causes: int
    episodes: int


def group_failures(results: ExperimentResults, database_folder: Path, report_folder: Path) -> Failures:
    """Returns the failures of an experiment by cause, the most frequent first.

    Args:
        results: the episodes.
        database_folder: folder that the episodes' folders are relative to.
        report_folder: folder of the report, which links are relative to.
    """
    table = results.episodes[results.episodes["status"] != EpisodeStatus.SUCCEEDED.value]
    causes = {text: _NUMBER.sub("…", text) for text in table["cause"].astype(str).unique()}
    keyed = table.assign(group=table["cause"].astype(str).map(causes))
    groups = list(keyed.groupby(["status", "group"], sort=False))
    groups.sort(key=lambda item: -len(item[1]))
    finder = _EpisodeReader(results, database_folder, report_folder)
    return Failures(
        tuple(finder.group(EpisodeStatus(str(key[0])), str(key[1]), rows) for key, rows in groups[:MOST_GROUPS]),
        len(groups),
        len(table),
    )


@dataclass(frozen=True, slots=True)
class _EpisodeReader:
    results: ExperimentResults
    database_folder: Path
    report_folder: Path

    def group(self, status: EpisodeStatus, pattern: str, rows: pd.DataFrame) -> FailureGroup:
        compared = self.results.description.compared
        counts = rows[compared].astype(str).value_counts()
        causes = rows["cause"].astype(str).unique()
        return FailureGroup(
            (str(causes[0]) if len(causes) == 1 else pattern) or "no cause was recorded",
            status,
            len(rows),
            tuple(self.episode(row) for row in rows.head(MOST_EPISODES).to_dict("records")),
            {str(method): int(count) for method, count in counts.items()},
        )

    def episode(self, row: Mapping[object, object]) -> FailedEpisode:
        description = self.results.description
        others = [factor.name for factor in description.factors if factor.name != description.compared]
        return FailedEpisode(
            int(str(row["number"])),
            str(row[description.compared]),
            ", ".join(f"{name} {row[name]}" for name in others),
            int(str(row["seed"])),
            EpisodeStatus(str(row["status"])),
            str(row["cause"]),
            episode_links(str(row["folder"] or ""), self.database_folder, self.report_folder),
        )


def episode_links(folder: str, database_folder: Path, report_folder: Path) -> tuple[Link, ...]:
    """Returns links to the folder of an episode and to its logs, videos and bags; nothing for a folder outside.

    Args:
        folder: of the episode, relative to `database_folder`; "" for none.
        database_folder: folder of the database.
        report_folder: folder of the report.
    """
    root = database_folder.resolve()
    path = (root / folder).resolve()
    if not folder or not path.is_relative_to(root) or not path.is_dir():
        return ()
    files = [item for item in sorted(path.iterdir()) if item.suffix in _KINDS and item.is_file()]
    named = [Link(f"{_KINDS[item.suffix]} {item.name}", _relative(item, report_folder)) for item in files[:MOST_FILES]]
    return (Link("folder", _relative(path, report_folder) + "/"), *named)


def _relative(path: Path, report_folder: Path) -> str:
    relative = Path(os.path.relpath(path, report_folder.resolve())).as_posix()
    return quote(relative if relative.startswith(".") else f"./{relative}")  # a colon is no scheme then


def failures_figure(failures: Failures, methods: tuple[str, ...]) -> NamedFigure | None:
    """Returns bars of the most frequent causes, by method; None without a failure."""
    if not failures.groups:
        return None
    groups = failures.groups[:MOST_BARS]
    names = unique_labels([group.cause for group in groups], 64)
    figure = go.Figure(
        [
            go.Bar(
                x=[group.by_method.get(method, 0) for group in groups], y=names, orientation="h", width=0.6,
                name=label(method), marker={"color": color_of(index), "opacity": 0.85},
                hovertemplate=f"{label(method)}: %{{x:,}}<extra></extra>",
            )
            for index, method in enumerate(methods)
        ]
    )  # fmt: skip
    stacked_bars(figure, height=130 + 34 * len(groups), value_title="episodes")
    summary = (
        f"Episodes that did not succeed, by cause and method: the {len(groups)} most frequent of "
        f"{counted(failures.causes, 'cause')}."
    )
    return NamedFigure("failures", "Failures by cause", summary, figure)
