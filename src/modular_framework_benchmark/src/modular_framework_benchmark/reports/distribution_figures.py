# SPDX-License-Identifier: BSD-3-Clause
"""Draws how the values of a metric are spread: boxes, and the share of the episodes at least as good as each value.

A figure stays small however many episodes there are: boxes are drawn from quartiles that are computed here from all
values, curves at a limited number of values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from modular_framework_benchmark.records.experiment import Direction, Metric, MetricKind
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.figure_style import (
    MUTED,
    NamedFigure,
    axis_title,
    color_of,
    dash_of,
    styled,
    unique_labels,
    words,
)
from modular_framework_benchmark.statistics.curves import Curve, performance_profile
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of

MOST_POINTS = 150  # of a method that are drawn one by one
FEWEST_VALUES = 3  # that differ; with fewer a table says it better
FARTHEST_LIMIT = 2.0  # largest values away from 0; one farther off would squeeze the values

Values = npt.NDArray[np.float64]


def distribution_figures(results: ExperimentResults, methods: Sequence[str]) -> Iterator[NamedFigure]:
    """Yields a figure for each metric that is no rate and has values that differ."""
    table = EpisodeTable(results)
    for metric in metrics_of(results):
        if metric.kind is MetricKind.RATE:
            continue
        values = [_seen_values(table, metric, method) for method in methods]
        if np.unique(np.concatenate(values)).size >= FEWEST_VALUES:
            profiles = [performance_profile(results, metric.name, method) for method in methods]
            yield _distribution_figure(metric, methods, values, profiles)


def _seen_values(table: EpisodeTable, metric: Metric, method: str) -> Values:
    """Returns the values that episodes gave: none of those that count at the limit."""
    seen = table.observations(metric, method)
    return seen.values[np.isfinite(seen.values) & ~seen.censored]


def _distribution_figure(
    metric: Metric, methods: Sequence[str], values: Sequence[Values], profiles: Sequence[Curve]
) -> NamedFigure:
    figure = make_subplots(cols=2, column_widths=[0.5, 0.5], horizontal_spacing=0.14)
    names = unique_labels(methods)
    for index, name in enumerate(names):
        if values[index].size:
            _add_box(figure, name, values[index], index)
            _add_profile(figure, name, profiles[index], index, "hv" if metric.better is Direction.LOWER else "vh")
    styled(figure, height=max(140 + 62 * len(methods), 290))
    figure.update_xaxes(title_text=axis_title(metric.name, metric.unit))
    figure.update_yaxes(
        tickvals=list(range(len(names))), ticktext=names, range=[len(names) - 0.5, -0.5], ticks="", row=1, col=1
    )
    figure.update_yaxes(
        title={"text": "share at least as good", "standoff": 14}, tickformat=".0%", range=[-0.02, 1.02], row=1, col=2
    )
    if _shows_limit(metric, values):
        for column in (1, 2):
            figure.add_vline(x=metric.limit, line={"color": MUTED, "dash": "dot", "width": 1}, row=1, col=column)
    return NamedFigure(
        f"distribution_{metric.name}", f"Distribution of {words(metric.name)}", _summary(metric, values), figure,
        metric.component,
    )  # fmt: skip


def _shows_limit(metric: Metric, values: Sequence[Values]) -> bool:
    return metric.limit is not None and abs(metric.limit) <= FARTHEST_LIMIT * float(
        np.abs(np.concatenate(values)).max()
    )


def _summary(metric: Metric, values: Sequence[Values]) -> str:
    text = (
        "Left: box from the lower to the upper quartile with the median; whiskers to the furthest value within 1.5 box "
        "lengths. Right: share of the episodes that are at least as good as each value, with its interval; higher "
        "curves are better."
    )
    if metric.limit is not None:
        limit = f"{metric.limit:g} {metric.unit}".strip() + (", dotted" if _shows_limit(metric, values) else "")
        text += f" Episodes at the limit ({limit}) are in no box and in no share: a curve may end below 100 %."
    if any(item.size > MOST_POINTS for item in values):
        text += f" Boxes are of all values; the points are {MOST_POINTS} of each method, evenly spaced in rank."
    return text


def _add_box(figure: go.Figure, name: str, values: Values, index: int) -> None:
    quartiles = np.quantile(values, (0.25, 0.5, 0.75))
    reach = 1.5 * (quartiles[2] - quartiles[0])
    inside = values[(values >= quartiles[0] - reach) & (values <= quartiles[2] + reach)]
    figure.add_trace(
        go.Box(
            q1=[quartiles[0]], median=[quartiles[1]], q3=[quartiles[2]],
            lowerfence=[inside.min()], upperfence=[inside.max()],
            y=[index - 0.1], orientation="h", name=name, showlegend=False,
            line={"color": color_of(index), "width": 1.5}, width=0.4, boxpoints=False, hoverinfo="x",
        ),
        row=1, col=1,
    )  # fmt: skip
    points = thinned(np.sort(values), MOST_POINTS)
    jitter = 0.09 * np.modf(np.arange(len(points)) * 0.618)[0]  # spread evenly, and the same in each report
    figure.add_trace(
        go.Scatter(
            x=points, y=index + 0.2 + jitter, mode="markers", showlegend=False, name=name,
            marker={"color": color_of(index), "size": 4, "opacity": 0.4}, hovertemplate="%{x:.4g}<extra></extra>",
        ),
        row=1, col=1,
    )  # fmt: skip


def _add_profile(figure: go.Figure, name: str, profile: Curve, index: int, line_shape: str) -> None:
    taus, share = np.asarray(profile.values, dtype=float), np.asarray(profile.fractions, dtype=float)
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
            x=taus, y=share, mode="lines", name=name, line_shape=line_shape,
            line={"color": color_of(index), "dash": dash_of(index), "width": 2},
            hovertemplate=f"{name}: %{{y:.1%}} at %{{x:.4g}}<extra></extra>",
        ),
        row=1, col=2,
    )  # fmt: skip


def thinned(ordered: Values, most: int) -> Values:
    """Returns at most `most` of the values, evenly spaced in rank, the first and the last among them."""
    if ordered.size <= most:
        return ordered
    return ordered[np.linspace(0, ordered.size - 1, most).round().astype(np.intp)]
