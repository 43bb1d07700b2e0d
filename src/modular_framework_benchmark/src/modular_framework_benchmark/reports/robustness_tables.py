# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the robustness of the methods."""

from __future__ import annotations

from modular_framework_benchmark.records.perturbation import PerturbedAxis
from modular_framework_benchmark.reports.figure_style import spaced_words
from modular_framework_benchmark.reports.number_text import NO_VALUE, count_text, percentage_text
from modular_framework_benchmark.reports.report_content import ReportContent
from modular_framework_benchmark.reports.robustness_figures import fall_text, side_text, value_text
from modular_framework_benchmark.reports.tables import Cell, Table, estimate_text, number_cells
from modular_framework_benchmark.statistics.observations import SUCCESS
from modular_framework_benchmark.statistics.robustness import CurvePoint, Robustness


def robustness_tables(content: ReportContent) -> tuple[Table, ...]:
    """Returns the falls in success along each axis, and success and progress at each level."""
    robustness = content.robustness
    return () if robustness is None else (_falls_table(robustness), _levels_table(robustness))


def _falls_table(robustness: Robustness) -> Table:
    wanted_success = robustness.perturbations.wanted_success
    rows = []
    for name in robustness.order:
        for curve in robustness.of_axis(name):
            sides = "; ".join(side_text(side, curve.axis, wanted_success) for side in curve.sides)
            at = value_text(curve.fall.value, curve.axis) if curve.fall else NO_VALUE
            numbers = number_cells(fall_text(curve) or NO_VALUE, at)
            rows.append((Cell(spaced_words(name)), Cell(curve.method), *numbers, Cell(sides)))
    columns = (
        "axis",
        "method",
        "largest fall [points] (interval)",
        "at",
        f"success of {percentage_text(wanted_success, 0)}",
    )
    caption = "Axes of perturbation, the axis with the largest mean fall in success first."
    return Table("robustness", caption, columns, tuple(rows), _notes(robustness))


def _notes(robustness: Robustness) -> tuple[str, ...]:
    fit = f"Curve: {robustness.fit}. Levels outside the tested levels are not predicted."
    claims = (
        f"Shown to reach or to be below: intervals of {percentage_text(robustness.joint_confidence, 2)} each, so that "
        f"{percentage_text(robustness.confidence, 0)} hold over all methods and sides of axes."
    )
    if robustness.no_claims:
        claims = f"Nothing is claimed, because {robustness.no_claims}."
    if not robustness.perturbations.one_at_a_time:
        return (
            fit,
            claims,
            "Fall: success of the best group of levels minus success of the worst group, a description only.",
        )
    fall = (
        "Fall: nominal success minus the lowest success of the tested levels, in the same scenes. Its interval is "
        "corrected for the number of levels and methods; the intervals of single levels are not."
    )
    return (fit, claims, fall)


def _levels_table(robustness: Robustness) -> Table:
    rows = [
        (
            Cell(spaced_words(curve.axis.name)),
            Cell(curve.method),
            *number_cells(
                _level_text(point, curve.axis),
                estimate_text(point.success.estimate, SUCCESS),
                estimate_text(point.progress.mean, SUCCESS) if point.progress else NO_VALUE,
                count_text(point.success.counts.succeeded),
                count_text(point.success.counts.counted),
            ),
        )
        for name in robustness.order
        for curve in robustness.of_axis(name)
        for point in curve.points
    ]
    columns = ("axis", "method", "level", "success [%] (interval)", "mean progress [%] (interval)", "successes",
               "episodes")  # fmt: skip
    caption = "Success and progress at each level of the perturbed axes; all other axes are nominal."
    if not robustness.perturbations.one_at_a_time:
        caption = "Success and progress in groups of levels; the other axes vary within each group."
    return Table("robustness_levels", caption, columns, tuple(rows))


def _level_text(point: CurvePoint, axis: PerturbedAxis) -> str:
    """Returns the level of a point, or the range of its group."""
    if point.low == point.high:
        return value_text(point.value, axis) + (" (nominal)" if point.value == axis.nominal else "")
    return f"{point.low:.3g} to {value_text(point.high, axis)}"
