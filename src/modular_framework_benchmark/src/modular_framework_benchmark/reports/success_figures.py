# SPDX-License-Identifier: BSD-3-Clause
"""Draws how often methods succeed: bars with intervals, differences between methods, and by level of other factors."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from modular_framework_benchmark.reports.figure_style import (
    INK,
    MUTED,
    NamedFigure,
    color_of,
    label,
    styled,
    unique_labels,
    words,
)
from modular_framework_benchmark.reports.number_text import count_text, counted, share_text
from modular_framework_benchmark.statistics.comparison import Comparison, MethodSummary

MOST_ROWS = 60


def success_figure(summaries: Sequence[MethodSummary]) -> NamedFigure | None:
    """Returns a bar for each method with its interval; None when no method has an episode.

    Args:
        summaries: of the metric `success`, over all levels of the other factors.
    """
    known = [(index, item, item.estimate) for index, item in enumerate(summaries) if item.estimate]
    if not known:
        return None
    names = unique_labels([item.method for _, item, _ in known])
    ends = [
        (share.value, share.value) if share.interval is None else (share.interval.low, share.interval.high)
        for _, _, share in known
    ]
    figure = go.Figure(
        go.Bar(
            x=[share.value for _, _, share in known], y=names, orientation="h", width=0.55,
            marker={"color": [color_of(index) for index, _, _ in known], "opacity": 0.85},
            text=[f" {share_text(share.value)} of {count_text(item.counts.counted)}" for _, item, share in known],
            textposition="inside", insidetextanchor="start", textfont={"color": "white", "size": 13},
            error_x={
                "type": "data", "symmetric": False, "color": INK, "thickness": 1.6, "width": 7,
                "array": [high - share.value for (_, high), (_, _, share) in zip(ends, known, strict=True)],
                "arrayminus": [share.value - low for (low, _), (_, _, share) in zip(ends, known, strict=True)],
            },
            hovertemplate="%{y}: %{x:.1%}<extra></extra>",
        )
    )  # fmt: skip
    styled(figure, height=110 + 58 * len(known))
    figure.update_layout(showlegend=False)
    figure.update_xaxes(range=[0, 1.02], tickformat=".0%", title_text="success")
    figure.update_yaxes(autorange="reversed", ticks="")
    summary = f"Share of the episodes that succeeded. Whiskers: {interval_words(known[0][1])}."
    return NamedFigure("success", "Success", summary, figure)


def interval_words(summary: MethodSummary) -> str:
    """Returns what the interval of a summary is: `95 % interval, Wilson`."""
    interval = summary.estimate.interval if summary.estimate else None
    if interval is None:
        return "none"
    return f"{share_text(interval.confidence, 0)} interval, {interval.method}"


def differences_figure(comparisons: Sequence[Comparison]) -> NamedFigure | None:
    """Returns the differences in success of all pairs of methods with their intervals; None without one.

    Args:
        comparisons: by the metric `success`.
    """
    known = [(item, item.difference) for item in comparisons if item.difference and item.difference.interval]
    if not known:
        return None
    names = unique_labels([f"{item.first} − {item.second}" for item, _ in known], 56)
    figure = go.Figure(
        go.Scatter(
            x=[100.0 * difference.value for _, difference in known], y=names, mode="markers",
            marker={"color": INK, "size": 10, "symbol": "diamond"},
            error_x={
                "type": "data", "symmetric": False, "color": INK, "thickness": 1.6, "width": 7,
                "array": [100.0 * (part.interval.high - part.value) for _, part in known if part.interval],
                "arrayminus": [100.0 * (part.value - part.interval.low) for _, part in known if part.interval],
            },
            hovertemplate="%{y}: %{x:+.1f} points<extra></extra>",
        )
    )  # fmt: skip
    figure.add_vline(x=0.0, line={"color": MUTED, "width": 1})
    styled(figure, height=120 + 44 * len(known))
    figure.update_layout(showlegend=False)
    figure.update_xaxes(title_text="difference in success [points]")
    figure.update_yaxes(autorange="reversed", ticks="")
    first = known[0][1].interval
    kind = f"{share_text(first.confidence, 0)} interval, {first.method}" if first else ""
    summary = f"Difference in success between methods. Whiskers: {kind}. Right of 0 the first method is better."
    return NamedFigure("differences", "Differences in success", summary, figure)


def levels_figure(summaries: Sequence[MethodSummary], methods: Sequence[str]) -> NamedFigure | None:
    """Returns a heat map of the success of each method at each level of the other factors; None without such factors.

    Args:
        summaries: of the metric `success`, of each method at each level.
        methods: names, in the order of the columns.
    """
    rows = list(dict.fromkeys(item.levels for item in summaries if item.levels))
    if not rows:
        return None
    found = {(item.levels, item.method): item for item in summaries}
    shown = rows[:MOST_ROWS]
    cells = [[found.get((row, method)) for method in methods] for row in shown]
    figure = go.Figure(
        go.Heatmap(
            z=[[cell.estimate.value if cell and cell.estimate else None for cell in line] for line in cells],
            x=unique_labels(methods), y=unique_labels([level_words(row) for row in shown]), zmin=0.0, zmax=1.0,
            xgap=3, ygap=3, colorscale=[[0.0, "#f0cfb8"], [0.5, "#f7f7f4"], [1.0, "#a9cbe6"]],
            text=[[_cell_text(cell) for cell in line] for line in cells], texttemplate="%{text}",
            colorbar={"tickformat": ".0%", "thickness": 10, "outlinewidth": 0},
            hovertemplate="%{y}, %{x}: %{z:.1%}<extra></extra>",
        )
    )  # fmt: skip
    styled(figure, height=100 + max(34 * len(shown), 100))
    figure.update_yaxes(autorange="reversed", ticks="", showgrid=False)
    figure.update_xaxes(side="top", ticks="", showgrid=False)
    summary = "Share of successes of each method at each level of the other factors, with the number of episodes."
    if len(rows) > len(shown):
        summary += f" The first {len(shown)} of {counted(len(rows), 'level')} are drawn; the table has all."
    return NamedFigure("levels", "Success by level of the other factors", summary, figure)


def level_words(levels: str) -> str:
    """Returns `object=can` as `object: can`."""
    factor, _, level = levels.partition("=")
    return f"{words(factor)}: {level}"


def _cell_text(cell: MethodSummary | None) -> str:
    if cell is None or cell.estimate is None:
        return "none"
    return label(f"{share_text(cell.estimate.value, 0)}  ({count_text(cell.counts.counted)})")
