# SPDX-License-Identifier: BSD-3-Clause
"""Shows the robustness of the methods: a figure per perturbed axis, and sentences."""

from __future__ import annotations

from collections.abc import Callable

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from modular_framework_benchmark.records.perturbation import AXES, FACTOR, PerturbedAxis
from modular_framework_benchmark.reports.figure_style import (
    MUTED,
    NamedFigure,
    apply_style,
    axis_title,
    color_of,
    dash_of,
    label_text,
    spaced_words,
    whiskers,
)
from modular_framework_benchmark.reports.number_text import interval_text, percentage_text
from modular_framework_benchmark.statistics.comparison import Estimate
from modular_framework_benchmark.statistics.robustness import (
    CrossingKind,
    CurvePoint,
    FittedSide,
    Robustness,
    RobustnessCurve,
)
from modular_framework_benchmark.statistics.sentences import enumeration

FIGURE_PREFIX = "robustness_"
MAX_BROKEN_LEVELS = 4
"""Maximum number of levels with broken or invalid episodes that a sentence names."""
CURVE_OFFSET = 0.008
"""Distance between the points of two methods at one level, as a fraction of the tested range."""


def robustness_figures(robustness: Robustness) -> list[NamedFigure]:
    """Returns a figure per axis: success, and progress if there are milestones, against the level of the axis."""
    return [_figure(robustness, axis) for axis in robustness.perturbations.axes if robustness.of_axis(axis.name)]


def _figure(robustness: Robustness, axis: PerturbedAxis) -> NamedFigure:
    curves = robustness.of_axis(axis.name)
    wanted = robustness.perturbations.wanted_success
    has_progress = any(point.progress is not None for curve in curves for point in curve.points)
    figure = make_subplots(cols=2 if has_progress else 1, horizontal_spacing=0.1)
    values = [point.value for curve in curves for point in curve.points]
    step = CURVE_OFFSET * (max(values) - min(values)) if values else 0.0
    for index, curve in enumerate(curves):
        shift = step * (index - (len(curves) - 1) / 2)
        figure.add_trace(_points(curve, index, shift, lambda point: point.success.estimate), row=1, col=1)
        for side in curve.sides:
            figure.add_trace(_line(side, curve.method, index), row=1, col=1)
        if has_progress:
            trace = _points(curve, index, shift, lambda point: point.progress.mean if point.progress else None)
            trace.update(showlegend=False, mode="lines+markers", line=_stroke(index))
            figure.add_trace(trace, row=1, col=2)
    figure.add_hline(y=100.0 * wanted, line={"color": MUTED, "width": 1, "dash": "dash"}, row=1, col=1)
    apply_style(figure, height=420)
    figure.update_xaxes(title_text=_title(axis))
    figure.update_yaxes(range=[-3, 103])
    figure.update_yaxes(title_text="success [%]", row=1, col=1)
    if has_progress:
        figure.update_yaxes(title_text="mean progress [%]", row=1, col=2)
    summary = (
        f"Success of each method against {spaced_words(axis.name)}, with {percentage_text(robustness.confidence, 0)} "
        f"intervals of single levels. Line: {robustness.fit}. Dashed: wanted success of {percentage_text(wanted, 0)}. "
        f"{spaced_words(axis.name).capitalize()}: {AXES[axis.name].description}"
    )
    return NamedFigure(f"{FIGURE_PREFIX}{axis.name}", f"Robustness to {spaced_words(axis.name)}", summary, figure)


def _title(axis: PerturbedAxis) -> str:
    return axis_title(axis.name, axis.unit)


def _stroke(index: int) -> dict[str, str]:
    return {"color": color_of(index), "dash": dash_of(index)}


def _points(
    curve: RobustnessCurve, index: int, shift: float, estimate_of: Callable[[CurvePoint], Estimate | None]
) -> go.Scatter:
    """Returns the estimates of a curve with their intervals."""
    estimates = [(point, estimate) for point in curve.points if (estimate := estimate_of(point)) is not None]
    return go.Scatter(
        x=[point.value + shift for point, _ in estimates], y=[100.0 * estimate.value for _, estimate in estimates],
        mode="markers",
        name=label_text(curve.method), legendgroup=curve.method, marker={"color": color_of(index), "size": 8},
        customdata=[
            (point.value, point.success.counts.succeeded, point.success.counts.episodes) for point, _ in estimates
        ],
        error_y=whiskers([estimate for _, estimate in estimates], 100.0, color_of(index), thickness=1.4, width=5),
        hovertemplate=f"{label_text(curve.method)}, level %{{customdata[0]:.4g}}: %{{y:.1f}} % "
        "(%{customdata[1]} of %{customdata[2]} episodes succeeded)<extra></extra>",
    )  # fmt: skip


def _line(side: FittedSide, method: str, index: int) -> go.Scatter:
    return go.Scatter(
        x=side.values, y=[100.0 * rate for rate in side.rates], mode="lines", line=_stroke(index),
        legendgroup=method, showlegend=False, hoverinfo="skip",
    )  # fmt: skip


def value_text(value: float, axis: PerturbedAxis) -> str:
    """Returns a value of an axis with its unit."""
    return f"{value:.3g}" if axis.unit == FACTOR else f"{value:.3g} {axis.unit}"


def side_text(side: FittedSide, axis: PerturbedAxis, wanted_success: float) -> str:
    """Returns the level at which a method falls below the wanted success; nothing outside the tested levels.

    Args:
        side: Fitted curve on one side of the nominal value.
        axis: Perturbed axis.
        wanted_success: Wanted success rate, from 0 to 1.
    """

    def text(value: float | None) -> str:
        return "" if value is None else value_text(value, axis)

    rate = percentage_text(wanted_success, 0)
    match side.kind:
        case CrossingKind.WITHIN:
            crossing_text = f"below {rate} at about {text(side.crossing)}, between {text(side.last_reached)} and "
            crossing_text += text(side.first_below)
        case CrossingKind.AT_NOMINAL:
            crossing_text = f"below {rate} at {text(side.first_below)} already"
        case CrossingKind.NOT_REACHED:
            crossing_text = f"not below {rate} at the tested levels, the last of which is {text(side.values[-1])}"
    shown_texts = [
        *([f"shown to reach {rate} up to {text(side.shown_reached)}"] if side.shown_reached is not None else []),
        *([f"shown to be below from {text(side.shown_below)}"] if side.shown_below is not None else []),
    ]
    return crossing_text + (f" ({'; '.join(shown_texts)})" if shown_texts else "")


def robustness_sentences(robustness: Robustness) -> tuple[str, ...]:
    """Returns the falls along the axes, and for each curve the level at which it falls below the wanted success."""
    wanted_success = robustness.perturbations.wanted_success
    lines = [_falls_sentence(robustness), _broken_sentence(robustness)]
    for name in robustness.order:
        for curve in robustness.of_axis(name):
            side_texts = [side_text(side, curve.axis, wanted_success) for side in curve.sides]
            if side_texts:
                lines.append(f"{spaced_words(name)}, {curve.method}: {' and '.join(side_texts)}")
    return tuple(line for line in lines if line)


def _falls_sentence(robustness: Robustness) -> str:
    """Returns the axes that are shown to lower success, and the axis with the largest mean fall."""
    name = next(iter(robustness.order), "")
    curves = [curve for curve in robustness.of_axis(name) if curve.fall is not None]
    if not curves:
        return ""
    falls = enumeration([f"{_fall_text(curve)} for {curve.method}" for curve in curves])
    largest = f"the largest mean fall in success is along {spaced_words(name)}: {falls}"
    if robustness.no_claims:
        return f"nothing is claimed about the robustness, because {robustness.no_claims}; {largest}"
    if not robustness.perturbations.one_at_a_time:
        return largest
    shown_axes = [
        spaced_words(axis) for axis in robustness.order if any(_is_shown(curve) for curve in robustness.of_axis(axis))
    ]
    verb = "are" if len(shown_axes) > 1 else "is"
    return f"{enumeration(shown_axes) if shown_axes else 'no axis'} {verb} shown to lower success; {largest}"


def _broken_sentence(robustness: Robustness) -> str:
    """Returns the levels with broken or invalid episodes, whose number may explain a fall."""
    counts: dict[str, None] = {}
    for curve in robustness.curves:
        for point in curve.points:
            broken = point.success.counts.broken + point.success.counts.invalid
            if broken:
                level = value_text(point.value, curve.axis)
                where = "nominal" if point.value == curve.axis.nominal else f"{spaced_words(curve.axis.name)} {level}"
                excluded = "" if point.success.estimate else " (no method was measured; excluded)"
                counts[f"{where}, {curve.method}: {broken} of {point.success.counts.episodes}{excluded}"] = None
    is_measured = any(point.success.estimate for curve in robustness.curves for point in curve.points)
    if not counts or not is_measured:
        return ""
    more = f"; {len(counts) - MAX_BROKEN_LEVELS} more" if len(counts) > MAX_BROKEN_LEVELS else ""
    return f"broken or invalid episodes, counted as failures: {'; '.join(list(counts)[:MAX_BROKEN_LEVELS])}{more}"


def _is_shown(curve: RobustnessCurve) -> bool:
    interval = None if curve.fall is None else curve.fall.points.interval
    return interval is not None and interval.low > 0.0


def _fall_text(curve: RobustnessCurve) -> str:
    assert curve.fall is not None
    at = value_text(curve.fall.value, curve.axis)
    return f"{fall_text(curve)} points at {at}"


def fall_text(curve: RobustnessCurve) -> str:
    """Returns the largest fall of a curve in points with its interval; "" without a fall."""
    if curve.fall is None:
        return ""
    points = curve.fall.points
    low, high = (None, None) if points.interval is None else (points.interval.low, points.interval.high)
    return interval_text(100.0 * points.value, _percent(low), _percent(high), "%")


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100.0 * fraction
