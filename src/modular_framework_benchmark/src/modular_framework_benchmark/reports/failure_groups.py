# SPDX-License-Identifier: BSD-3-Clause
"""Groups unsuccessful episodes by cause, with links to their files."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import pandas as pd
import plotly.graph_objects as go

from modular_framework_benchmark.metrics.recording_files import TASK_RECORDS
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.results import FAILURE_CLASS, ExperimentResults
from modular_framework_benchmark.reports.figure_style import (
    REPLAY,
    NamedFigure,
    color_of,
    label_text,
    stacked_bars,
    unique_labels,
)
from modular_framework_benchmark.reports.number_text import count_phrase
from modular_framework_benchmark.statistics.observations import other_factors

MAX_GROUPS = 40
MAX_EPISODES = 10
MAX_BARS = 12
MAX_FILES = 6
REPLAY_COMMAND = "rosrun modular_framework_ui page --replay"
_NUMBER_PATTERN = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")
_KIND_OF_SUFFIX = {".log": "log", ".mp4": "video", ".webm": "video", ".bag": "bag"}


@dataclass(frozen=True, slots=True)
class Link:
    """A link of the report: visible text, and target relative to the report, percent-encoded; or a command instead."""

    text: str
    target: str = ""
    command: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeFiles:
    """Files of the episodes of an experiment, and the commands that replay the episodes.

    Attributes:
        database: SQLite file; label with "://" for a server.
        experiment: Name of the experiment.
        database_folder: Base of the episodes' folders.
        report_folder: Folder of the report, the base of its links.
    """

    database: str
    experiment: str
    database_folder: Path
    report_folder: Path

    @property
    def replay(self) -> str:
        """Returns the start of the commands that replay an episode or a failure class; an option completes them.

        The database of a server is reached with a password, which a report must not contain, so that the option is then
        the folder of an episode.
        """
        if self._is_on_server:
            return REPLAY_COMMAND
        return f"{REPLAY_COMMAND} {shlex.join([self.database, '--experiment', self.experiment])}"

    def links(self, number: int, folder: str) -> tuple[Link, ...]:
        """Returns links to the folder of an episode and its logs, videos and bags, and the command that replays it.

        There are no links to a folder outside the base.

        Args:
            number: Number of the episode.
            folder: Folder of the episode, relative to `database_folder`; "" for none.
        """
        path = self._path(folder)
        if path is None:
            return ()
        files = [item for item in sorted(path.iterdir()) if item.suffix in _KIND_OF_SUFFIX and item.is_file()]
        links = [Link("folder", _relative(path, self.report_folder) + "/")]
        links += [
            Link(f"{_KIND_OF_SUFFIX[item.suffix]} {item.name}", _relative(item, self.report_folder))
            for item in files[:MAX_FILES]
        ]
        if option := self.episode_option(number, folder):
            links.append(Link("replay", command=f"{self.replay} {option}"))
        return tuple(links)

    def episode_option(self, number: int, folder: str) -> str:
        """Returns the option that completes `replay` for an episode; "" without a record of its task.

        Args:
            number: Number of the episode.
            folder: Folder of the episode, relative to `database_folder`; "" for none.
        """
        path = self._path(folder)
        if path is None or not (path / TASK_RECORDS).is_dir():
            return ""
        return shlex.quote(str(path)) if self._is_on_server else f"--episode {number}"

    def class_option(self, failure_class: str) -> str:
        """Returns the option that completes `replay` for a failure class; "" without a class or with a server."""
        if not failure_class or self._is_on_server:
            return ""
        return shlex.join(["--failure-class", failure_class])

    def class_link(self, failure_class: str) -> Link | None:
        """Returns the command that lists the episodes of a failure class; None without a class or with a server."""
        option = self.class_option(failure_class)
        return Link("replay", command=f"{self.replay} {option}") if option else None

    @property
    def _is_on_server(self) -> bool:
        return "://" in self.database

    def _path(self, folder: str) -> Path | None:
        """Returns the path of the folder of an episode; None without the folder, or outside the base."""
        if not folder:
            return None
        root = self.database_folder.resolve()
        path = (root / folder).resolve()
        return path if path.is_relative_to(root) and path.is_dir() else None


@dataclass(frozen=True, slots=True, kw_only=True)
class FailedEpisode:
    """An unsuccessful episode.

    Attributes:
        number: Number of the episode.
        method: Method of the episode.
        levels: Levels of the other factors as text.
        seed: Seed of the episode.
        status: Final status.
        cause: Cause of the failure.
        links: Links to its folder and files.
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
    """Episodes of the same class with the same cause, except for numbers in its text.

    Attributes:
        failure_class: Class of the failures; "" without classes.
        cause: Cause; `…` replaces numbers that differ between episodes.
        status: Final status of these episodes.
        episodes: Number of episodes.
        shown: First episodes of the group.
        by_method: Number of episodes, keyed by method.
        replay: Command that lists the episodes of the class on the page; None if no shown episode has a record.
    """

    failure_class: str
    cause: str
    status: EpisodeStatus
    episodes: int
    shown: tuple[FailedEpisode, ...]
    by_method: Mapping[str, int]
    replay: Link | None

    @property
    def caption(self) -> str:
        """Returns a caption with the number of episodes shown."""
        every = count_phrase(self.episodes, "episode")
        return f"All {every}." if len(self.shown) == self.episodes else f"The first {len(self.shown)} of {every}."


@dataclass(frozen=True, slots=True)
class Failures:
    """Failures of an experiment.

    Attributes:
        classes: Numbers of episodes by method of each class, the most frequent class first; of each cause without
            classes.
        groups: Most frequent causes, at most MOST_GROUPS.
        causes: Number of causes.
        episodes: Number of unsuccessful episodes.
    """

    classes: Mapping[str, Mapping[str, int]]
    groups: tuple[FailureGroup, ...]
    causes: int
    episodes: int


def group_failures(results: ExperimentResults, files: EpisodeFiles) -> Failures:
    """Returns the failures of an experiment by cause, the most frequent first.

    Args:
        results: Finished episodes.
        files: Files of the episodes.
    """
    table = results.episodes[results.episodes["status"] != EpisodeStatus.SUCCEEDED.value]
    causes = {text: _NUMBER_PATTERN.sub("…", text) for text in table["cause"].astype(str).unique()}
    classes = table[FAILURE_CLASS].astype(str) if FAILURE_CLASS in table else ""
    keyed = table.assign(group=table["cause"].astype(str).map(causes), **{FAILURE_CLASS: classes})
    groups = list(keyed.groupby([FAILURE_CLASS, "status", "group"], sort=False))
    groups.sort(key=lambda item: -len(item[1]))
    finder = _EpisodeReader(results, files)
    failure_groups = tuple(finder.group(keys, rows) for keys, rows in groups)
    return Failures(
        _by_class(failure_groups),
        failure_groups[:MAX_GROUPS],
        len(groups),
        len(table),
    )


def _by_class(groups: Sequence[FailureGroup]) -> dict[str, dict[str, int]]:
    """Returns the numbers of episodes by method, keyed by class or cause, the most frequent first."""
    counts: dict[str, dict[str, int]] = {}
    for group in groups:
        of_class = counts.setdefault(group.failure_class or group.cause, {})
        for method, number in group.by_method.items():
            of_class[method] = of_class.get(method, 0) + number
    return dict(sorted(counts.items(), key=lambda item: -sum(item[1].values())))


@dataclass(frozen=True, slots=True)
class _EpisodeReader:
    results: ExperimentResults
    files: EpisodeFiles

    def group(self, keys: tuple[object, ...], rows: pd.DataFrame) -> FailureGroup:
        failure_class, status, pattern = map(str, keys)
        compared = self.results.description.compared
        counts = rows[compared].astype(str).value_counts()
        causes = rows["cause"].astype(str).unique()
        shown = tuple(self.episode(row) for row in rows.head(MAX_EPISODES).to_dict("records"))
        has_record = any(link.command for episode in shown for link in episode.links)
        return FailureGroup(
            failure_class,
            (str(causes[0]) if len(causes) == 1 else pattern) or "no cause was recorded",
            EpisodeStatus(status),
            len(rows),
            shown,
            {str(method): int(count) for method, count in counts.items()},
            self.files.class_link(failure_class) if has_record else None,
        )

    def episode(self, row: Mapping[object, object]) -> FailedEpisode:
        return FailedEpisode(
            number=int(str(row["number"])),
            method=str(row[self.results.description.compared]),
            levels=", ".join(f"{factor.name} {row[factor.name]}" for factor in other_factors(self.results)),
            seed=int(str(row["seed"])),
            status=EpisodeStatus(str(row["status"])),
            cause=str(row["cause"]),
            links=self.files.links(int(str(row["number"])), str(row["folder"] or "")),
        )


def _relative(path: Path, report_folder: Path) -> str:
    relative = Path(os.path.relpath(path, report_folder.resolve())).as_posix()
    return quote(relative if relative.startswith(".") else f"./{relative}")  # keeps a colon from ending a scheme


def failures_figure(failures: Failures, methods: tuple[str, ...], files: EpisodeFiles) -> NamedFigure | None:
    """Returns a bar chart of the classes of failures by method, or None without failures; of causes without classes.

    Args:
        failures: Unsuccessful episodes.
        methods: Names of the methods.
        files: Files of the episodes.
    """
    if not failures.classes:
        return None
    shown_classes = dict(list(failures.classes.items())[:MAX_BARS])
    with_records = {group.failure_class for group in failures.groups if group.replay is not None}
    options = [files.class_option(name) if name in with_records else "" for name in shown_classes]
    names = unique_labels(list(shown_classes), 64)
    figure = go.Figure(
        [
            go.Bar(
                x=[counts.get(method, 0) for counts in shown_classes.values()], y=names, orientation="h", width=0.6,
                name=label_text(method), marker={"color": color_of(index), "opacity": 0.85},
                hovertemplate=f"{label_text(method)}: %{{x:,}}<extra></extra>",
                customdata=options, meta=REPLAY,
            )
            for index, method in enumerate(methods)
        ]
    )  # fmt: skip
    stacked_bars(figure, height=130 + 34 * len(shown_classes), value_title="episodes")
    noun = "class" if failures.groups[0].failure_class else "cause"
    summary = f"Unsuccessful episodes by {noun} and method."
    command = " Select a bar for the command that lists its episodes on the page." if any(options) else ""
    if len(failures.classes) > len(shown_classes):
        summary = (
            f"{summary[:-1]}: the {len(shown_classes)} most frequent of {count_phrase(len(failures.classes), noun)}."
        )
    return NamedFigure("failures", f"Failures by {noun}", summary + command, figure)
