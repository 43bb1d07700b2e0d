# SPDX-License-Identifier: BSD-3-Clause
"""Figures of time: per component and method, within single episodes, and progress of the experiment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from modular_framework_benchmark.reports.figure_style import (
    FAILED,
    REPLAY,
    NamedFigure,
    apply_style,
    color_of,
    dash_of,
    label_text,
    spaced_words,
    stacked_bars,
    unique_labels,
)
from modular_framework_benchmark.reports.number_text import number_text
from modular_framework_benchmark.reports.span_tables import ChosenEpisode, SpanSummary

MAX_STEPS = 300
STATE_COLORS = (
    "#8ecae6",
    "#b7e4c7",
    "#ffd6a5",
    "#cdb4db",
    "#f1c0b9",
    "#d8e2a8",
    "#a9bcd0",
    "#e9d8a6",
    "#bde0fe",
    "#d6ccc2",
)


def components_figure(summaries: Sequence[SpanSummary], methods: Sequence[str]) -> NamedFigure | None:
    """Returns stacked bars of the components' time per episode, or None without recorded components."""
    components = [item for item in summaries if item.kind == "component"]
    if not components:
        return None
    names = list(dict.fromkeys(item.name for item in components))
    labels = unique_labels(methods)
    time_of = {(item.name, item.method): item.per_episode_s for item in components}
    figure = go.Figure(
        [
            go.Bar(
                x=[time_of.get((name, method), 0.0) for method in methods], y=labels, orientation="h", width=0.5,
                name=label_text(spaced_words(name)), marker={"color": STATE_COLORS[index % len(STATE_COLORS)]},
                text=[f"{number_text(time_of.get((name, method), 0.0))} s" for method in methods],
                textposition="inside", insidetextanchor="middle", textangle=0,
                hovertemplate=f"{label_text(name)}: %{{x:.3g}} s<extra></extra>",
            )
            for index, name in enumerate(names)
        ]
    )  # fmt: skip
    stacked_bars(figure, height=140 + 50 * len(methods), value_title="mean real time per episode [s]")
    summary = (
        "Real time of each component, averaged over all episodes of the method. Concurrent work, such as "
        "concurrent plans, counts once; an episode in which a component did not run counts as 0 s."
    )
    return NamedFigure("components", "Time by component", summary, figure)


def timelines_figure(chosen: Sequence[ChosenEpisode], spans: pd.DataFrame) -> NamedFigure | None:
    """Returns the states and components of some episodes over time, or None without states.

    Args:
        chosen: Episodes to draw.
        spans: Spans of these episodes in the order of their starts.
    """
    with_states = set(spans.loc[spans["kind"] == "state", "number"])
    episodes = [item for item in chosen if item.number in with_states]
    if not episodes:
        return None
    of_episode = {item.number: spans[spans["number"] == item.number] for item in episodes}
    states = list(dict.fromkeys(name for rows in of_episode.values() for name in _leaves(rows)["name"]))
    colors = {name: STATE_COLORS[index % len(STATE_COLORS)] for index, name in enumerate(states)}
    figure = go.Figure()
    shown_names: set[str] = set()
    for row, item in enumerate(episodes):
        first = len(figure.data)
        for span in _leaves(of_episode[item.number]).to_dict("records"):
            _add_span(
                figure,
                span,
                y=row - 0.12,
                width=0.44,
                color=colors[span["name"]],
                in_legend=str(span["name"]) not in shown_names,
            )
            shown_names.add(str(span["name"]))
        for span in _components(of_episode[item.number]).to_dict("records"):
            _add_span(figure, span, y=row + 0.24, width=0.14, color="#5f6c7b", in_legend=False)
        for bar in figure.data[first:]:
            bar.update(customdata=[item.option], meta=REPLAY)
    apply_style(figure, height=150 + 52 * len(episodes))
    figure.update_layout(barmode="overlay")
    labels = [
        f"{label_text(item.method, 24)}<br>no. {item.number}, {spaced_words(item.status.value)}"
        + (", cold start" if item.started_cold else "")
        for item in episodes
    ]
    figure.update_yaxes(
        tickvals=list(range(len(episodes))),
        ticktext=labels,
        range=[len(episodes) - 0.5, -0.5],
        ticks="",
        showgrid=False,
    )
    figure.update_xaxes(title_text="real time since the start of the episode [s]", rangemode="tozero")
    summary = (
        "States (wide bars) and components (narrow grey bars) of an episode. Red edges: failed; hatched: never "
        "ended. Each method has a success of median duration and the first failure of the most frequent cause."
    )
    if any(item.option for item in episodes):
        summary += " Select a bar for the command that opens its episode on the page."
    return NamedFigure("timelines", "Timelines of single episodes", summary, figure)


def _leaves(spans: pd.DataFrame) -> pd.DataFrame:
    """Returns the states that contain no other state, according to their paths."""
    states = spans[spans["kind"] == "state"]
    paths = [str(name).rstrip("/") + "/" for name in states["name"]]
    inner = [not any(other != path and other.startswith(path) for other in paths) for path in paths]
    return states[np.array(inner, dtype=bool)]


def _components(spans: pd.DataFrame) -> pd.DataFrame:
    return spans[spans["kind"] == "component"]


def _add_span(
    figure: go.Figure, span: dict[str, object], *, y: float, width: float, color: str, in_legend: bool
) -> None:
    started = float(str(span["started_s"]))
    ended = span["ended_s"]
    unended = ended is None or not np.isfinite(float(str(ended)))
    length = 0.5 if unended else float(str(ended)) - started
    failed = bool(span["failed"]) or unended
    name, reason = label_text(str(span["name"]).strip("/")), label_text(str(span["reason"] or ""), 120)
    end = "never ended" if unended else f"{number_text(length)} s"
    figure.add_trace(
        go.Bar(
            x=[length], base=[started], y=[y], orientation="h", width=width, name=name, legendgroup=name,
            showlegend=in_legend,
            marker={
                "color": color, "line": {"color": FAILED if failed else "white", "width": 2 if failed else 0.5},
                "pattern": {"shape": "/" if unended else "", "fgcolor": FAILED},
            },
            hovertemplate=f"{name}: {end}" + (f"<br>{reason}" if reason else "") + "<extra></extra>",
        )
    )  # fmt: skip


def progress_figure(episodes: pd.DataFrame, planned: int) -> NamedFigure | None:
    """Returns the number of finished episodes over time, or None without recorded start times.

    Args:
        episodes: Table of the episodes.
        planned: Number of planned episodes.
    """
    ended = (episodes["begun"].astype(float) + episodes["wall_s"].astype(float)).dropna()
    if ended.empty:
        return None
    order = ended.sort_values(kind="stable").to_numpy()
    ranks = np.unique(np.linspace(0, order.size - 1, min(order.size, MAX_STEPS)).round().astype(np.intp))
    begin = float(episodes["begun"].astype(float).min())
    hours = (order[ranks] - begin) / 3600.0
    unit, scale = ("h", 1.0) if hours[-1] >= 2.0 else ("min", 60.0)
    figure = go.Figure(
        go.Scatter(
            x=np.concatenate(([0.0], hours * scale)), y=np.concatenate(([0], ranks + 1)), mode="lines",
            line={"color": color_of(0), "dash": dash_of(0), "width": 2}, showlegend=False,
            hovertemplate=f"%{{y:,}} finished after %{{x:.3g}} {unit}<extra></extra>",
        )
    )  # fmt: skip
    figure.add_hline(y=planned, line={"color": "#5f6c7b", "dash": "dot", "width": 1})
    apply_style(figure, height=260)
    figure.update_xaxes(title_text=f"time since the start of the first episode [{unit}]", rangemode="tozero")
    figure.update_yaxes(title_text="finished episodes", range=[0, 1.06 * planned], tickformat=",d")
    return NamedFigure(
        "progress", "Progress", "Finished episodes over time; dotted: number of planned episodes.", figure
    )
