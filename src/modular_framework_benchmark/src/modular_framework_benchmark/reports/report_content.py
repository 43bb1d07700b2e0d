# SPDX-License-Identifier: BSD-3-Clause
"""Collects the content of a report, independent of its layout."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import pandas as pd

from modular_framework_benchmark.experiments.perturb_reading import perturbations_of, with_run_labels
from modular_framework_benchmark.records.experiment import ExperimentDescription, Metric
from modular_framework_benchmark.records.perturbation import PERTURBATION
from modular_framework_benchmark.records.results import COLD_START, ExperimentResults
from modular_framework_benchmark.reports.distribution_figures import distribution_figures
from modular_framework_benchmark.reports.failure_groups import EpisodeFiles, Failures, failures_figure, group_failures
from modular_framework_benchmark.reports.figure_style import NamedFigure
from modular_framework_benchmark.reports.robustness_figures import robustness_figures
from modular_framework_benchmark.reports.run_record import (
    CombinationSnapshots,
    RecordedValue,
    SnapshotValues,
    commands_to_repeat,
    others_fractions,
    recorded_values,
    warnings_of,
)
from modular_framework_benchmark.reports.span_tables import (
    ChosenEpisode,
    SpanSummary,
    choose_episodes,
    milestone_episodes,
    summarise_spans,
)
from modular_framework_benchmark.reports.success_figures import (
    differences_figure,
    levels_figure,
    milestones_figure,
    ranking_figure,
)
from modular_framework_benchmark.reports.time_figures import components_figure, progress_figure, timelines_figure
from modular_framework_benchmark.results.own_table import MODE
from modular_framework_benchmark.statistics.analysis import analyse, summarise_by_level
from modular_framework_benchmark.statistics.comparison import Analysis, MethodSummary
from modular_framework_benchmark.statistics.observations import metrics_of, unmeasured_reason
from modular_framework_benchmark.statistics.robustness import Robustness, analyse_robustness

SUCCESS = "success"
MAX_PAIRED_METHODS = 3  # maximum number of methods with one figure per pair; more methods are ranked in one figure
COMPONENTS = ("task", "generation", "planning", "execution", "grasp", "policy")  # user components follow


@dataclass(frozen=True, slots=True)
class ReportSource:
    """Source of a report's data, and its destination.

    Attributes:
        database: Database as named by the user.
        database_folder: Base of the episodes' folders.
        report_folder: Folder of the report, the base of its links.
        snapshots: Distinct values of each snapshot part with their numbers of episodes.
        combinations: The same by combination of levels.
        span_totals: Sums of all spans for `summarise_spans`.
        milestone_levels: Combinations of levels at which episodes have each milestone, keyed by milestone.
        spans_of: Function that reads the spans of the episodes with the given numbers.
    """

    database: str
    database_folder: Path
    report_folder: Path
    snapshots: SnapshotValues
    combinations: CombinationSnapshots
    span_totals: pd.DataFrame
    milestone_levels: Mapping[str, Sequence[Mapping[str, str]]]
    spans_of: Callable[[Sequence[int]], pd.DataFrame]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFacts:
    """Times and numbers of an experiment's run.

    Attributes:
        begun: Start of the first episode [s since 1970]; None without episodes.
        ended: End of the last episode [s since 1970]; None without episodes.
        episode_s: Sum of the durations of the episodes [s].
        workers: Number of workers.
        seeds: Number of distinct seeds.
        trials: Number of distinct trials.
        cold_starts: Number of episodes that were the first of their stack.
        others_median: Fraction of the machine that other processes used during an episode, median; None if unknown.
        others_max: Maximum of this fraction; None if unknown.
    """

    begun: float | None
    ended: float | None
    episode_s: float
    workers: int
    seeds: int
    trials: int
    cold_starts: int
    others_median: float | None
    others_max: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """Content of a report.

    Attributes:
        description: Description of the experiment.
        planned: Number of planned episodes.
        finished: Number of finished episodes.
        facts: Times and numbers of the run.
        analysis: Statistical analysis.
        metrics: Metrics in the order of the components.
        levels: Success of each method at each level of the other factors.
        robustness: Success of each method along each perturbed axis; None without perturbations.
        spans: Time of states and components.
        chosen: Episodes whose timelines are shown.
        failures: Unsuccessful episodes by cause.
        figures: All figures.
        recorded: Versions, machine, parameters.
        warnings: Warnings at the top of the report.
        commands: Commands that repeat the experiment.
        replay: Start of the commands that replay an episode or a failure class.
    """

    description: ExperimentDescription
    planned: int
    finished: int
    facts: RunFacts
    analysis: Analysis
    metrics: tuple[Metric, ...]
    levels: tuple[MethodSummary, ...]
    robustness: Robustness | None
    spans: tuple[SpanSummary, ...]
    chosen: tuple[ChosenEpisode, ...]
    failures: Failures
    figures: tuple[NamedFigure, ...]
    recorded: tuple[RecordedValue, ...]
    warnings: tuple[str, ...]
    commands: tuple[str, ...]
    replay: str

    @property
    def is_table(self) -> bool:
        """Returns whether another program measured the episodes, so that there is nothing to repeat."""
        return self.description.mode == MODE

    @property
    def unit_noun(self) -> str:
        """Returns the noun for an independent unit of the comparisons."""
        return next((item.unit_noun for item in self.analysis.comparisons), "episode")

    @property
    def components(self) -> tuple[str, ...]:
        """Returns the components with metrics."""
        return tuple(dict.fromkeys(metric.component for metric in self.metrics))


def gather_content(results: ExperimentResults, source: ReportSource, mean_intervals: bool = False) -> ReportContent:
    """Returns the content of the report of an experiment.

    Args:
        results: Finished episodes.
        source: Source of further data.
        mean_intervals: See `analyse`.
    """
    description = results.description
    analysis = analyse(results, mean_intervals=mean_intervals)
    levels, robustness = _success_by_level(results), _robustness(results)
    files = EpisodeFiles(
        database=source.database,
        experiment=results.description.name,
        database_folder=source.database_folder,
        report_folder=source.report_folder,
    )
    chosen = choose_episodes(results, files)
    timelines = source.spans_of([item.number for item in chosen])
    spans = summarise_spans(results, source.span_totals, timelines)
    failures = group_failures(results, files)
    recorded = recorded_values(source.snapshots)
    metrics = tuple(sorted(metrics_of(results), key=_component_order))
    methods = analysis.methods
    figures = _comparison_figures(results, analysis, files) + _existing_figures(
        milestones_figure(spans, milestone_episodes(results, source.milestone_levels)),
        *(robustness_figures(robustness) if robustness is not None else ()),
        components_figure(spans, methods),
        levels_figure(levels, methods),
        timelines_figure(chosen, timelines),
        failures_figure(failures, methods, files),
        progress_figure(results.episodes, results.planned),
    )
    return ReportContent(
        description=description, planned=results.planned, finished=len(results.episodes),
        facts=_run_facts(results, source.snapshots), analysis=analysis, metrics=metrics, levels=levels,
        robustness=robustness, spans=spans, chosen=chosen, failures=failures, figures=tuple(figures), recorded=recorded,
        warnings=warnings_of(results, source.snapshots, source.combinations),
        commands=commands_to_repeat(results, recorded, source.database),
        replay=files.replay,
    )  # fmt: skip


def _component_order(metric: Metric) -> int:
    return COMPONENTS.index(metric.component) if metric.component in COMPONENTS else len(COMPONENTS)


def _success_by_level(results: ExperimentResults) -> tuple[MethodSummary, ...]:
    description = results.description
    excluded = (description.compared, PERTURBATION)  # robustness curves show the perturbations
    other_factors = [factor.name for factor in description.factors if factor.name not in excluded]
    return tuple(item for name in other_factors for item in summarise_by_level(results, name) if item.metric == SUCCESS)


def _robustness(results: ExperimentResults) -> Robustness | None:
    description = results.description
    labels = next((factor.levels for factor in description.factors if factor.name == PERTURBATION), ())
    perturbations = perturbations_of(description.text) if labels else None
    if perturbations is None or unmeasured_reason(results):
        return None
    return analyse_robustness(results, with_run_labels(perturbations, labels))


def _comparison_figures(results: ExperimentResults, analysis: Analysis, files: EpisodeFiles) -> list[NamedFigure]:
    return _existing_figures(
        ranking_figure(analysis.summaries, main_metric(results.description)),
        differences_figure([item for item in analysis.comparisons if item.metric == SUCCESS])
        if len(analysis.methods) <= MAX_PAIRED_METHODS
        else None,
        *distribution_figures(results, analysis.methods, files),
    )


def main_metric(description: ExperimentDescription) -> Metric | None:
    """Returns the first metric of an experiment other than success."""
    return next((item for item in description.metrics if item.name != SUCCESS), None)


def _existing_figures(*figures: NamedFigure | None) -> list[NamedFigure]:
    return [figure for figure in figures if figure is not None]


def _run_facts(results: ExperimentResults, snapshots: SnapshotValues) -> RunFacts:
    episodes = results.episodes
    if episodes.empty:
        return RunFacts(
            begun=None,
            ended=None,
            episode_s=0.0,
            workers=0,
            seeds=0,
            trials=0,
            cold_starts=0,
            others_median=None,
            others_max=None,
        )
    start_times_s, wall = episodes["begun"].astype(float), episodes["wall_s"].astype(float)
    ended = (start_times_s + wall).max()
    other_fractions = others_fractions(snapshots)
    return RunFacts(
        begun=float(start_times_s.min()) if math.isfinite(start_times_s.min()) else None,
        ended=float(ended) if math.isfinite(ended) else None,
        episode_s=float(wall.sum()),
        workers=int(episodes["worker"].nunique()),
        seeds=int(episodes["seed"].nunique()),
        trials=int(episodes["trial"].nunique()),
        cold_starts=int(episodes[COLD_START].sum()) if COLD_START in episodes else 0,
        others_median=statistics.median(other_fractions) if other_fractions else None,
        others_max=max(other_fractions, default=None),
    )


def machine_readable(content: ReportContent) -> dict[str, Any]:
    """Returns the claims of a report as JSON values, which the page embeds so that programs can check them."""
    return plain_json(
        {
            "experiment": content.description.name,
            "digest": content.description.digest,
            "compared": content.description.compared,
            "planned": content.planned,
            "finished": content.finished,
            "analysis": asdict(content.analysis),
            "levels": [asdict(item) for item in content.levels],
            "robustness": None if content.robustness is None else asdict(content.robustness),
            "spans": [asdict(item) for item in content.spans],
            "failures": asdict(content.failures),
            "warnings": content.warnings,
        }
    )


def plain_json(value: Any) -> Any:
    """Returns a JSON value: lists for tuples, values for enumerations, None for numbers that are not finite."""
    match value:
        case Mapping():
            return {str(key): plain_json(inner) for key, inner in value.items()}
        case Enum():
            return value.value
        case list() | tuple():
            return [plain_json(inner) for inner in value]
        case float() if not math.isfinite(value):
            return None
        case _:
            return value
