# SPDX-License-Identifier: BSD-3-Clause
"""How all figures look: colours that colour-blind readers tell apart, plain axes, labels whose text is shown as it is.

Plotly reads a part of HTML in every text it draws. So each text that comes from a database passes `label`.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, field

import plotly.graph_objects as go

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6B3A", "#5B5B5B")  # Okabe and Ito's
DASHES = ("solid", "dash", "dot", "dashdot")
INK, MUTED, LINES, FAILED = "#1f2933", "#5f6c7b", "#e3e8ee", "#b3261e"
LONGEST_LABEL = 48


@dataclass(frozen=True)
class NamedFigure:
    """A figure of a report.

    Attributes:
        name: How the command line names it, such as `success`; unique in a report.
        title: Heading.
        summary: What is drawn, in a sentence or two, for those who see the figure and those who do not; says so where
            points are a sample.
        figure: The figure, without a title of its own.
        component: Component it is about; "" for the whole experiment.
    """

    name: str
    title: str
    summary: str
    figure: go.Figure = field(repr=False)
    component: str = ""


def label(text: str, longest: int = LONGEST_LABEL) -> str:
    """Returns a text that Plotly shows as it is, shortened with an ellipsis."""
    shown = "".join(letter if letter.isprintable() else " " for letter in text)
    if len(shown) > longest:
        shown = shown[: longest - 1] + "…"
    return html.escape(shown, quote=False).replace("%{", "%&#123;")


def color_of(index: int) -> str:
    """Returns the colour of the method with that index."""
    return COLORS[index % len(COLORS)]


def dash_of(index: int) -> str:
    """Returns the dash of the line of a method: differs where colours repeat."""
    return DASHES[index // len(COLORS) % len(DASHES)]


def axis_title(name: str, unit: str) -> str:
    """Returns the title of an axis: a name without underscores, and a unit in brackets."""
    return label(words(name)) + (f" [{label(unit)}]" if unit else "")


def words(name: str) -> str:
    """Returns an identifier as words."""
    return name.replace("_", " ")


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Gives a figure the common look.

    Args:
        figure: what is drawn; changed.
        height: [px].
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
    """Gives horizontal bars the common look: the parts of a bar one behind the other, the first bar on top.

    Args:
        figure: horizontal bars; changed.
        height: [px].
        value_title: title of the axis of values.
    """
    styled(figure, height)
    figure.update_layout(barmode="stack", legend_traceorder="normal")
    figure.update_xaxes(title_text=value_title)
    figure.update_yaxes(autorange="reversed", ticks="")
    return figure


def unique_labels(names: Sequence[str], longest: int = LONGEST_LABEL) -> list[str]:
    """Returns labels for a categorical axis; names that look alike when shortened stay apart."""
    shown: list[str] = []
    for name in names:
        text = label(name, longest)
        while text in shown:
            text += " ′"
        shown.append(text)
    return shown
