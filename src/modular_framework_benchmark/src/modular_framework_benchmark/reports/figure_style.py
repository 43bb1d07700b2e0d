# SPDX-License-Identifier: BSD-3-Clause
"""Common style of all figures: colours for colour-blind readers, plain axes, escaped labels.

Plotly interprets some HTML in every text, so each text from a database passes through `label_text`.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import plotly.graph_objects as go

from modular_framework_benchmark.statistics.comparison import Estimate

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6B3A", "#5B5B5B")  # Okabe and Ito's
DASHES = ("solid", "dash", "dot", "dashdot")
INK, MUTED, LINES, FAILED = "#1f2933", "#5f6c7b", "#e3e8ee", "#b3261e"
MAX_LABEL_LENGTH = 48
REPLAY = "replay"
"""`meta` of a trace whose `customdata` are the options that replay the episode or class of each mark; "" for none."""


@dataclass(frozen=True)
class NamedFigure:
    """A figure of a report.

    Attributes:
        name: Name on the command line, such as `success`; unique in a report.
        title: Heading.
        summary: Description in a sentence or two, also for readers who cannot see the figure; mentions sampling of
            points.
        figure: Figure without a title.
        component: Component of the figure; "" for the whole experiment.
    """

    name: str
    title: str
    summary: str
    figure: go.Figure = field(repr=False)
    component: str = ""


def label_text(text: str, max_length: int = MAX_LABEL_LENGTH) -> str:
    """Returns a text that Plotly displays literally, shortened with an ellipsis."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    if len(printable) > max_length:
        printable = printable[: max_length - 1] + "…"
    return html.escape(printable, quote=False).replace("%{", "%&#123;")


def color_of(index: int) -> str:
    """Returns the colour of the method with this index."""
    return COLORS[index % len(COLORS)]


def dash_of(index: int) -> str:
    """Returns the line dash of the method with this index, which differs when colours repeat."""
    return DASHES[index // len(COLORS) % len(DASHES)]


def axis_title(name: str, unit: str) -> str:
    """Returns the title of an axis: the name with spaces, and the unit in brackets."""
    return label_text(spaced_words(name)) + (f" [{label_text(unit)}]" if unit else "")


def spaced_words(name: str) -> str:
    """Returns an identifier with spaces for underscores."""
    return name.replace("_", " ")


def apply_style(figure: go.Figure, height: int) -> go.Figure:
    """Applies the common style to a figure.

    Args:
        figure: Figure to modify.
        height: Height [px].
    """
    figure.update_layout(
        template="none",
        height=height,
        autosize=True,
        margin={"l": 70, "r": 20, "t": 30, "b": 60},
        font={"family": "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif", "size": 13, "color": INK},
        paper_bgcolor="white",
        plot_bgcolor="white",
        legend={"orientation": "h", "yref": "container", "yanchor": "bottom", "y": 0.0, "xanchor": "left", "x": 0.0},
        hoverlabel={"align": "left"},
    )
    axis = {
        "gridcolor": LINES,
        "linecolor": MUTED,
        "zeroline": False,
        "automargin": True,
        "ticks": "outside",
        "title_font_size": 13,
    }
    figure.update_xaxes(**axis, tickcolor=LINES)
    figure.update_yaxes(**axis, tickcolor=LINES)
    return figure


def stacked_bars(figure: go.Figure, height: int, value_title: str) -> go.Figure:
    """Applies the common style to horizontal bars: stacked parts, the first bar at the top.

    Args:
        figure: Figure of horizontal bars to modify.
        height: Height [px].
        value_title: Title of the value axis.
    """
    apply_style(figure, height)
    figure.update_layout(barmode="stack", legend_traceorder="normal")
    figure.update_xaxes(title_text=value_title)
    figure.update_yaxes(autorange="reversed", ticks="")
    return figure


def unique_labels(names: Sequence[str], max_length: int = MAX_LABEL_LENGTH) -> list[str]:
    """Returns distinct labels for a categorical axis, even if shortened names are equal."""
    labels: list[str] = []
    for name in names:
        text = label_text(name, max_length)
        while text in labels:
            text += " ′"
        labels.append(text)
    return labels


def whiskers(estimates: Sequence[Estimate], scale: float, color: str, **line: float) -> dict[str, Any]:
    """Returns the error bars of estimates with intervals; infinite ends are not drawn.

    Args:
        estimates: Estimates; estimates without an interval have bars of zero length.
        scale: Units of the axis per unit of the estimates.
        color: Colour.
        **line: Further settings of the bars, such as their width [px].
    """

    def lengths(factor: float, ends: Sequence[float]) -> list[float]:
        parts = zip(estimates, ends, strict=True)
        return [factor * (end - part.value) if math.isfinite(end) else 0.0 for part, end in parts]

    return {
        "type": "data",
        "symmetric": False,
        "color": color,
        "array": lengths(scale, [part.interval.high if part.interval else part.value for part in estimates]),
        "arrayminus": lengths(-scale, [part.interval.low if part.interval else part.value for part in estimates]),
        **line,
    }
