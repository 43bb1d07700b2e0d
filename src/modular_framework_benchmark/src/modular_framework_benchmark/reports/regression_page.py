# SPDX-License-Identifier: BSD-3-Clause
"""Presents the changes between two experiments as text and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import plotly.graph_objects as go

from modular_framework_benchmark.reports.figure_style import (
    MUTED,
    NamedFigure,
    apply_style,
    spaced_words,
    unique_labels,
    whiskers,
)
from modular_framework_benchmark.reports.html_page import render_page
from modular_framework_benchmark.reports.number_text import count_phrase, number_text, p_value_text
from modular_framework_benchmark.reports.regression import Change, MetricChange, Regression
from modular_framework_benchmark.reports.report_content import plain_json
from modular_framework_benchmark.reports.tables import Cell, Table, metric_title, pairs_text, table_text, wins_text
from modular_framework_benchmark.statistics.comparison import Estimate

COLOR_OF_CHANGE = {Change.BETTER: "#176639", Change.WORSE: "#b3261e"}
DIFFERENCES_TITLE = "The runs also differ in the following, which may cause a change"
MOOD_OF_CHANGE = {Change.BETTER: "better", Change.WORSE: "worse"}


def changes_table(regression: Regression) -> Table:
    """Returns a table of each metric of each method before and after, with the change."""
    rows = tuple(_row(item) for item in regression.changes)
    columns = (
        "method",
        "metric",
        "before",
        "after",
        "won − lost [points] (interval)",
        "p corrected",
        "pairs",
        "result",
    )
    return Table("changes", "Each metric of each method in both experiments.", columns, rows, regression.notes)


def _row(item: MetricChange) -> tuple[Cell, ...]:
    comparison = item.comparison
    scale = 100.0 if item.metric.is_fraction else 1.0
    before, after = (
        number_text(None if value is None else scale * value, unit=item.metric.unit)
        for value in (comparison.second_estimate, comparison.first_estimate)
    )
    is_shown = item.change in MOOD_OF_CHANGE
    return (
        Cell(item.method),
        Cell(metric_title(item.metric)),
        Cell(before, is_number=True),
        Cell(after, is_number=True),
        Cell(wins_text(comparison), is_number=True),
        Cell(p_value_text(comparison.p_corrected), is_number=True),
        Cell(pairs_text(comparison.counts), is_number=True),
        Cell(item.change.value, is_shown, mood=MOOD_OF_CHANGE.get(item.change, "")),
    )


def summary_sentences(regression: Regression) -> tuple[str, ...]:
    """Returns the changes as sentences, regressions first."""
    counts = {change: regression.count(change) for change in Change}
    text = (
        f"{count_phrase(counts[Change.WORSE], 'metric')} of methods got worse, {counts[Change.BETTER]:,} better; "
        f"no difference is shown in {counts[Change.NOT_SHOWN]:,}"
    )
    if counts[Change.NOT_SHOWABLE]:
        text += f", none could have been shown in {counts[Change.NOT_SHOWABLE]:,}"
    if counts[Change.NO_DATA]:
        text += f", nothing to compare in {counts[Change.NO_DATA]:,}"
    ordered = [item for change in (Change.WORSE, Change.BETTER) for item in regression.changes if item.change is change]
    return (text, *(f"{item.method}: {item.comparison.sentence}" for item in ordered))


def regression_text(regression: Regression) -> str:
    """Returns the comparison as plain text."""
    table = changes_table(regression)
    marks = (
        [f"{DIFFERENCES_TITLE}:", *(f"  {text}" for text in regression.differing), ""] if regression.differing else []
    )
    return "\n".join([*marks, *summary_sentences(regression), "", table_text(table), "", *table.notes]) + "\n"


def regression_page(regression: Regression, before: str, after: str) -> str:
    """Returns the comparison as a self-contained page.

    Args:
        regression: Comparison of the experiments.
        before: Database of the earlier experiment.
        after: Database of the later experiment.
    """
    figure = _figure(regression)
    figures = [figure] if figure else []
    data = {
        "before": regression.before.name,
        "after": regression.after.name,
        "confidence": regression.confidence,
        "differing": regression.differing,
        "changes": [
            {"method": item.method, "change": item.change.value, **asdict(item.comparison)}
            for item in regression.changes
        ],
    }
    return render_page(
        "regression.html.jinja",
        plain_json(data),
        figures,
        regression=regression,
        differing=DIFFERENCES_TITLE,
        sentences=summary_sentences(regression),
        table=changes_table(regression),
        figures=figures,
        before=before,
        after=after,
        same_episodes=regression.before.digest == regression.after.digest,
    )


def _figure(regression: Regression) -> NamedFigure | None:
    """Returns a figure of the win differences of all metrics in points."""
    differences = [(item, item.comparison.difference) for item in regression.changes]
    bars = [(item, difference) for item, difference in differences if difference and difference.interval]
    if not bars:
        return None
    figure = go.Figure(_markers(bars))
    figure.add_vline(x=0.0, line={"color": MUTED, "width": 1})
    apply_style(figure, height=130 + 30 * len(bars))
    figure.update_layout(showlegend=False)
    figure.update_xaxes(title_text="pairs in which the later experiment is better − worse [points]")
    figure.update_yaxes(range=[len(bars) - 0.5, -0.5], ticks="")
    summary = "Win differences with their intervals. Green: shown to be better; red: worse; grey: no difference shown."
    return NamedFigure("changes", "Changes", summary, figure)


def _markers(bars: Sequence[tuple[MetricChange, Estimate]]) -> list[go.Scatter]:
    names = unique_labels([f"{item.method}, {spaced_words(item.metric.name)}" for item, _ in bars], 56)
    colors = [COLOR_OF_CHANGE.get(item.change, MUTED) for item, _ in bars]
    return [
        go.Scatter(
            x=[100.0 * difference.value], y=[name], mode="markers", marker={"color": color, "size": 9},
            error_x=whiskers([difference], 100.0, color, thickness=1.6, width=5),
            hovertemplate="%{y}: %{x:+.3g}<extra></extra>",
        )
        for name, color, (_, difference) in zip(names, colors, bars, strict=True)
    ]  # fmt: skip
