# SPDX-License-Identifier: BSD-3-Clause
"""Figures of success: ranking with intervals, pairs of methods, levels of other factors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from modular_framework_benchmark.records.experiment import Direction, Metric
from modular_framework_benchmark.reports.figure_style import (
    INK,
    MUTED,
    NamedFigure,
    apply_style,
    axis_title,
    color_of,
    dash_of,
    label_text,
    spaced_words,
    unique_labels,
    whiskers,
)
from modular_framework_benchmark.reports.number_text import count_phrase, count_text, percentage_text
from modular_framework_benchmark.reports.span_tables import SpanSummary
from modular_framework_benchmark.statistics.comparison import Comparison, Estimate, MethodSummary

MAX_ROWS = 60


def ranking_figure(summaries: Sequence[MethodSummary], main: Metric | None) -> NamedFigure | None:
    """Returns success and the main metric of each method with intervals, the best method first; None without episodes.

    Args:
        summaries: Summaries of each method for each metric, over all levels of the other factors.
        main: Metric beside success; None for none.
    """
    of_success = {item.method: item.estimate for item in summaries if item.metric == "success" and item.estimate}
    if not of_success:
        return None
    values = {item.method: item.estimate for item in summaries if main and item.metric == main.name and item.estimate}
    sign = -1.0 if main and main.better is Direction.HIGHER else 1.0

    def sort_key(method: str) -> tuple[float, float]:
        return -of_success[method].value, sign * values[method].value if method in values else math.inf

    ranked = sorted(of_success, key=sort_key)
    drawn = [estimate for estimate in values.values() if math.isfinite(estimate.value)]
    figure = make_subplots(cols=2 if drawn else 1, shared_yaxes=True, horizontal_spacing=0.06)
    names = unique_labels(ranked)
    figure.add_trace(_dots(names, [of_success[method] for method in ranked], 100.0), row=1, col=1)
    apply_style(figure, height=110 + 34 * len(ranked))
    figure.update_xaxes(range=[-2, 102], title_text="success [%]", row=1, col=1)
    if main and drawn:
        figure.add_trace(_dots(names, [values.get(method) for method in ranked], 1.0), row=1, col=2)
        figure.update_xaxes(title_text="median " + axis_title(main.name, main.unit), row=1, col=2)
    figure.update_layout(showlegend=False)
    figure.update_yaxes(autorange="reversed", ticks="", categoryorder="array", categoryarray=names)
    rank = "by success" + (f", then by {spaced_words(main.name)}" if main else "")
    summary = f"Methods ranked {rank}. Whiskers are intervals of single methods; differences are compared above."
    return NamedFigure("ranking", "Methods, the best first", summary, figure)


def _dots(names: Sequence[str], estimates: Sequence[Estimate | None], scale: float) -> go.Scatter:
    """Returns a dot per estimate, with whiskers for an interval; infinite ends are not drawn."""
    known_parts = [
        (name, part) for name, part in zip(names, estimates, strict=True) if part and math.isfinite(part.value)
    ]
    return go.Scatter(
        x=[scale * part.value for _, part in known_parts], y=[name for name, _ in known_parts], mode="markers",
        marker={"color": INK, "size": 9},
        error_x=whiskers([part for _, part in known_parts], scale, INK, thickness=1.6, width=6),
        hovertemplate="%{y}: %{x:.4g}<extra></extra>",
    )  # fmt: skip


def differences_figure(comparisons: Sequence[Comparison]) -> NamedFigure | None:
    """Returns the differences in success of all pairs of methods with intervals, or None without pairs.

    Args:
        comparisons: Comparisons for the metric `success`.
    """
    known_differences = [
        (item, item.difference) for item in comparisons if item.difference and item.difference.interval
    ]
    if not known_differences:
        return None
    names = unique_labels([f"{item.first} − {item.second}" for item, _ in known_differences], 56)
    figure = go.Figure(_dots(names, [difference for _, difference in known_differences], 100.0))
    figure.add_vline(x=0.0, line={"color": MUTED, "width": 1})
    apply_style(figure, height=120 + 44 * len(known_differences))
    figure.update_layout(showlegend=False)
    figure.update_xaxes(title_text="difference in success [points]")
    figure.update_yaxes(autorange="reversed", ticks="")
    first = known_differences[0][1].interval
    kind = f"{percentage_text(first.confidence, 0)} interval, {first.method}" if first else ""
    summary = f"Difference in success between methods. Whiskers: {kind}. Right of 0 the first method is better."
    return NamedFigure("differences", "Differences in success", summary, figure)


def levels_figure(summaries: Sequence[MethodSummary], methods: Sequence[str]) -> NamedFigure | None:
    """Returns a heat map of success by method and level of the other factors, or None without other factors.

    Args:
        summaries: Summaries of the metric `success` for each method at each level.
        methods: Names of the methods in the order of the columns.
    """
    rows = list(dict.fromkeys(item.levels for item in summaries if item.levels))
    if not rows:
        return None
    summary_of = {(item.levels, item.method): item for item in summaries}
    shown_rows = rows[:MAX_ROWS]
    cells = [[summary_of.get((row, method)) for method in methods] for row in shown_rows]
    figure = go.Figure(
        go.Heatmap(
            z=[[cell.estimate.value if cell and cell.estimate else None for cell in line] for line in cells],
            x=unique_labels(methods), y=unique_labels([level_words(row) for row in shown_rows]), zmin=0.0, zmax=1.0,
            xgap=3, ygap=3, colorscale=[[0.0, "#f0cfb8"], [0.5, "#f7f7f4"], [1.0, "#a9cbe6"]],
            text=[[_cell_text(cell) for cell in line] for line in cells], texttemplate="%{text}",
            colorbar={"tickformat": ".0%", "thickness": 10, "outlinewidth": 0},
            hovertemplate="%{y}, %{x}: %{z:.1%}<extra></extra>",
        )
    )  # fmt: skip
    apply_style(figure, height=100 + max(34 * len(shown_rows), 100))
    figure.update_yaxes(autorange="reversed", ticks="", showgrid=False)
    figure.update_xaxes(side="top", ticks="", showgrid=False)
    summary = "Success rate of each method at each level of the other factors, with the number of episodes."
    if len(rows) > len(shown_rows):
        summary += f" The first {len(shown_rows)} of {count_phrase(len(rows), 'level')} are drawn; the table has all."
    return NamedFigure("levels", "Success by level of the other factors", summary, figure)


def milestones_figure(spans: Sequence[SpanSummary], episodes: Mapping[str, Mapping[str, int]]) -> NamedFigure | None:
    """Returns the fraction of each method's episodes that reached each milestone, or None without milestones.

    Args:
        spans: Spans by kind, name and method.
        episodes: Number of finished episodes that have each milestone, keyed by method and milestone. An episode
            without a record reached no milestone.
    """
    milestones = [item for item in spans if item.kind == "milestone"]
    names = list(dict.fromkeys(item.name for item in milestones))
    if not names:
        return None
    reached = {(item.method, item.name): item.runs - item.failed for item in milestones}
    labels = unique_labels([spaced_words(name) for name in names], 24)
    figure = go.Figure()
    for index, (method, counts) in enumerate(episodes.items()):
        fractions = [(reached.get((method, name), 0), counts.get(name, 0)) for name in names]
        figure.add_trace(
            go.Scatter(
                x=labels, y=[100.0 * number / count if count else None for number, count in fractions],
                name=label_text(method), mode="lines+markers", customdata=fractions, marker={"size": 8},
                line={"color": color_of(index), "dash": dash_of(index)},
                hovertemplate=f"{label_text(method)}: %{{customdata[0]}} of %{{customdata[1]}} episodes<extra></extra>",
            )
        )  # fmt: skip
    apply_style(figure, height=380)
    figure.update_yaxes(range=[-2, 102], title_text="episodes that reached it [%]")
    summary = (
        "Fraction of each method's finished episodes that reached each milestone, in the order of the task. Episodes "
        "whose levels do not have a milestone are not counted for it."
    )
    return NamedFigure("milestones", "How far", summary, figure)


def level_words(levels: str) -> str:
    """Returns `object=can` as `object: can`."""
    factor, _, level = levels.partition("=")
    return f"{spaced_words(factor)}: {level}"


def _cell_text(cell: MethodSummary | None) -> str:
    if cell is None or cell.estimate is None:
        return "none"
    return label_text(f"{percentage_text(cell.estimate.value, 0)}  ({count_text(cell.counts.counted)})")
