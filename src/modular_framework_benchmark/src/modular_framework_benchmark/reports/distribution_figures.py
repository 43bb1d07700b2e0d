# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a metric's distribution: box plots and performance profiles.

The size of a figure is bounded: box plots use quartiles of all values computed here, and profiles have a limited number
of points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.failure_groups import EpisodeFiles
from modular_framework_benchmark.reports.figure_style import (
    MUTED,
    REPLAY,
    NamedFigure,
    apply_style,
    axis_title,
    color_of,
    dash_of,
    spaced_words,
    unique_labels,
)
from modular_framework_benchmark.statistics.curves import Curve, performance_profile
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of

MAX_POINTS = 150  # drawn individually per method
MIN_DISTINCT_VALUES = 3  # minimum number of distinct values; a table shows fewer values better
MAX_LIMIT_RATIO = 2.0  # relative to the largest absolute value; a larger limit would compress the values

Values = NDArray[np.float64]


def distribution_figures(
    results: ExperimentResults, methods: Sequence[str], files: EpisodeFiles
) -> Iterator[NamedFigure]:
    """Yields a figure for each metric, except rates, with enough distinct values.

    Args:
        results: Finished episodes.
        methods: Names of the methods.
        files: Files of the episodes.
    """
    table = EpisodeTable(results)
    rows = results.episodes[["number", "folder"]].itertuples(index=False, name=None)
    options = {int(number): files.episode_option(int(number), str(folder or "")) for number, folder in rows}
    for metric in metrics_of(results):
        if metric.kind is MetricKind.RATE:
            continue
        dots = [_measured_dots(table, metric, method, options) for method in methods]
        if np.unique(np.concatenate([each.values for each in dots])).size >= MIN_DISTINCT_VALUES:
            profiles = [performance_profile(results, metric.name, method) for method in methods]
            yield _distribution_figure(metric, methods, dots, profiles)


@dataclass(frozen=True, slots=True)
class _Dots:
    """Measured values of a method, ascending, without episodes that count at the limit.

    Attributes:
        values: Values, shape (n,).
        numbers: Number of the episode of each value.
        options: Option that replays the episode of each value; "" without a record.
    """

    values: Values
    numbers: tuple[int, ...]
    options: tuple[str, ...]


def _measured_dots(table: EpisodeTable, metric: Metric, method: str, options: Mapping[int, str]) -> _Dots:
    observed = table.observations(metric, method)
    measured = np.flatnonzero(np.isfinite(observed.values) & ~observed.censored)
    ascending = measured[np.argsort(observed.values[measured], kind="stable")]
    numbers = tuple(table.numbers(method)[ascending].tolist())
    return _Dots(observed.values[ascending], numbers, tuple(options[number] for number in numbers))


def _distribution_figure(
    metric: Metric, methods: Sequence[str], dots: Sequence[_Dots], profiles: Sequence[Curve]
) -> NamedFigure:
    values = [each.values for each in dots]
    figure = make_subplots(cols=2, column_widths=[0.5, 0.5], horizontal_spacing=0.14)
    names = unique_labels(methods)
    for index, name in enumerate(names):
        if values[index].size:
            _add_box(figure, name, dots[index], index)
            _add_profile(figure, name, profiles[index], index, "hv" if metric.better is Direction.LOWER else "vh")
    apply_style(figure, height=max(140 + 62 * len(methods), 290))
    figure.update_xaxes(title_text=axis_title(metric.name, metric.unit))
    figure.update_yaxes(
        tickvals=list(range(len(names))), ticktext=names, range=[len(names) - 0.5, -0.5], ticks="", row=1, col=1
    )
    figure.update_yaxes(
        title={"text": "fraction at least as good", "standoff": 14}, tickformat=".0%", range=[-0.02, 1.02], row=1, col=2
    )
    if _shows_limit(metric, values):
        for column in (1, 2):
            figure.add_vline(x=metric.limit, line={"color": MUTED, "dash": "dot", "width": 1}, row=1, col=column)
    return NamedFigure(
        f"distribution_{metric.name}", f"Distribution of {spaced_words(metric.name)}", _summary(metric, dots), figure,
        metric.component,
    )  # fmt: skip


def _shows_limit(metric: Metric, values: Sequence[Values]) -> bool:
    return metric.limit is not None and abs(metric.limit) <= MAX_LIMIT_RATIO * float(
        np.abs(np.concatenate(values)).max()
    )


def _summary(metric: Metric, dots: Sequence[_Dots]) -> str:
    values = [each.values for each in dots]
    text = (
        "Left: box from the lower to the upper quartile with the median; whiskers to the farthest value within 1.5 box "
        "lengths. Right: fraction of the episodes that are at least as good as each value, with its interval; higher "
        "curves are better."
    )
    if metric.limit is not None:
        limit = f"{metric.limit:g} {metric.unit}".strip() + (", dotted" if _shows_limit(metric, values) else "")
        text += f" Episodes at the limit ({limit}) are in no box and no fraction, so a curve may end below 100 %."
    if any(option for each in dots for option in each.options):
        text += " Select a dot for the command that opens its episode on the page."
    if any(item.size > MAX_POINTS for item in values):
        text += f" Boxes include all values; {MAX_POINTS} points of each method are drawn, evenly spaced in rank."
    return text


def _add_box(figure: go.Figure, name: str, dots: _Dots, index: int) -> None:
    values = dots.values
    quartiles = np.quantile(values, (0.25, 0.5, 0.75))
    whisker = 1.5 * (quartiles[2] - quartiles[0])
    within_whiskers = values[(values >= quartiles[0] - whisker) & (values <= quartiles[2] + whisker)]
    figure.add_trace(
        go.Box(
            q1=[quartiles[0]], median=[quartiles[1]], q3=[quartiles[2]],
            lowerfence=[within_whiskers.min()], upperfence=[within_whiskers.max()],
            y=[index - 0.1], orientation="h", name=name, showlegend=False,
            line={"color": color_of(index), "width": 1.5}, width=0.4, boxpoints=False, hoverinfo="x",
        ),
        row=1, col=1,
    )  # fmt: skip
    shown = thinned_ranks(values.size, MAX_POINTS)
    jitter = 0.09 * np.modf(np.arange(len(shown)) * 0.618)[0]  # evenly spaced, so that the figure is reproducible
    figure.add_trace(
        go.Scatter(
            x=values[shown], y=index + 0.2 + jitter, mode="markers", showlegend=False, name=name,
            marker={"color": color_of(index), "size": 4, "opacity": 0.4},
            text=[f"episode {dots.numbers[rank]}" for rank in shown], hovertemplate="%{text}: %{x:.4g}<extra></extra>",
            customdata=[dots.options[rank] for rank in shown], meta=REPLAY,
        ),
        row=1, col=1,
    )  # fmt: skip


def _add_profile(figure: go.Figure, name: str, profile: Curve, index: int, line_shape: str) -> None:
    taus, fraction = np.asarray(profile.values, dtype=float), np.asarray(profile.fractions, dtype=float)
    low, high = np.asarray(profile.low, dtype=float), np.asarray(profile.high, dtype=float)
    red, green, blue = (int(color_of(index)[start : start + 2], 16) for start in (1, 3, 5))
    figure.add_trace(
        go.Scatter(
            x=np.concatenate((taus, taus[::-1])), y=np.concatenate((high, low[::-1])), fill="toself", mode="none",
            fillcolor=f"rgba({red},{green},{blue},0.12)", showlegend=False, hoverinfo="skip", name=name,
        ),
        row=1, col=2,
    )  # fmt: skip
    figure.add_trace(
        go.Scatter(
            x=taus, y=fraction, mode="lines", name=name, line_shape=line_shape,
            line={"color": color_of(index), "dash": dash_of(index), "width": 2},
            hovertemplate=f"{name}: %{{y:.1%}} at %{{x:.4g}}<extra></extra>",
        ),
        row=1, col=2,
    )  # fmt: skip


def thinned_ranks(size: int, max_count: int) -> NDArray[np.intp]:
    """Returns at most `max_count` of the ranks 0 to size - 1, evenly spaced, including the first and the last rank."""
    return np.linspace(0, size - 1, min(size, max_count)).round().astype(np.intp)
