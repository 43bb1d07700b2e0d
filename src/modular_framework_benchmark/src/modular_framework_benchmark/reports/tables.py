# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a report as rows of texts, shared by the page, Markdown and LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_benchmark.records.experiment import Metric
from modular_framework_benchmark.reports.figure_style import spaced_words
from modular_framework_benchmark.reports.number_text import (
    NO_VALUE,
    count_phrase,
    count_text,
    interval_text,
    number_text,
    p_value_text,
    percentage_text,
)
from modular_framework_benchmark.reports.report_content import MAX_PAIRED_METHODS, SUCCESS, ReportContent, main_metric
from modular_framework_benchmark.reports.robustness_figures import robustness_sentences
from modular_framework_benchmark.reports.success_figures import level_words
from modular_framework_benchmark.statistics.comparison import (
    Comparison,
    Estimate,
    MethodSummary,
    PairCounts,
    Verdict,
)
from modular_framework_benchmark.statistics.observations import SUCCESS as SUCCESS_METRIC
from modular_framework_benchmark.statistics.sentences import enumeration, needed_episodes
from modular_framework_benchmark.statistics.values import MIN_UNITS
from modular_framework_ros.reported_figures import Source

NO_BREAK = "\u00a0"


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: Text of the cell.
        is_strong: Whether the cell is emphasised as a main result.
        is_number: Whether the cell is aligned as a number.
        mood: `better` or `worse` for a change that is shown; otherwise "".
    """

    text: str
    is_strong: bool = False
    is_number: bool = False
    mood: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes:
        name: Identifier, unique in a report.
        caption: Caption.
        columns: Column titles.
        rows: Rows of cells; the first cell is the row heading.
        notes: Notes below the table.
    """

    name: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def number_cells(*texts: str) -> tuple[Cell, ...]:
    """Returns a cell with a number for each text."""
    return tuple(Cell(text, is_number=True) for text in texts)


def table_text(table: Table) -> str:
    """Returns a table as plain text."""
    rows = [table.columns, *(tuple(cell.text for cell in row) for row in table.rows)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(table.columns))]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def answer_text(content: ReportContent) -> str:
    """Returns the summary at the top of a report as plain text."""
    main = main_metric(content.description)
    needed = _needed_episodes(content, [main] if main else [])
    return "\n".join(
        [table_text(answer_table(content)), "", *answer_sentences(content), *needed, content.analysis.scope]
    )


def overview_table(content: ReportContent) -> Table:
    """Returns each metric of each method with its interval, and the shown differences."""
    methods = content.analysis.methods
    summary_of = {(item.metric, item.method): item for item in content.analysis.summaries}
    rows = []
    for metric in content.metrics:
        of_metric = [item for item in content.analysis.comparisons if item.metric == metric.name]
        best = _better_than_all(of_metric, methods)
        estimates = [
            Cell(estimate_text(_estimate(summary_of.get((metric.name, method))), metric), method == best, True)
            for method in methods
        ]
        rows.append((Cell(metric_title(metric)), *estimates, Cell(shown_text(of_metric))))
    confidence = percentage_text(content.description.confidence, 0)
    caption = (
        "Each metric by method: rate, or median with failures ranked worst, with its "
        f"{confidence} interval; none below 6 {content.unit_noun}s. Bold: shown to be better than every other method."
    )
    notes = (content.analysis.rule, content.analysis.scope, _without_interval(content))
    return Table("overview", caption, ("metric", *methods, "what is shown"), tuple(rows), notes)


def _without_interval(content: ReportContent) -> str:
    """Returns the fraction of figures without an interval."""
    estimates = [item.estimate for item in content.analysis.summaries if item.estimate]
    estimates += [item.difference for item in content.analysis.comparisons if item.difference]
    without = sum(estimate.interval is None for estimate in estimates)
    return f"{without} of {count_phrase(len(estimates), 'figure')} (rates, medians and differences) have no interval."


def _needed_episodes(content: ReportContent, metrics: Sequence[Metric]) -> list[str]:
    """Returns a sentence for each mean that would have an interval with more episodes; none below MIN_UNITS units."""
    sentences = []
    for metric in metrics:
        means = {
            item.method: item.mean
            for item in content.analysis.summaries
            if item.metric == metric.name and item.mean is not None and item.counts.units >= MIN_UNITS
        }
        needed = {method: mean.needed_episodes for method, mean in means.items() if mean.needed_episodes is not None}
        if needed:
            sentences.append(needed_episodes(metric, means[next(iter(needed))].name, needed))
    return sentences


def answer_table(content: ReportContent) -> Table:
    """Returns a row per method: episodes, success, the main metric, and the most frequent failure."""
    main = main_metric(content.description)
    summary_of = {(item.metric, item.method): item for item in content.analysis.summaries}
    success = next(metric for metric in content.metrics if metric.name == SUCCESS)
    rows = []
    for method in content.analysis.methods:
        counts = summary_of[SUCCESS, method].counts
        row = [
            Cell(method),
            Cell(f"{counts.succeeded:,} of {counts.episodes:,}", is_number=True),
            Cell(estimate_text(summary_of[SUCCESS, method].estimate, success), is_number=True),
        ]
        if main is not None:
            row.append(Cell(estimate_text(summary_of[main.name, method].estimate, main), is_number=True))
        causes = [group for group in content.failures.groups if group.by_method.get(method)]
        most_frequent = max(causes, key=lambda group: group.by_method[method], default=None)
        row.append(
            Cell(f"{most_frequent.by_method[method]}: {most_frequent.cause[:90]}" if most_frequent else NO_VALUE)
        )
        rows.append(tuple(row))
    columns = ["method", "succeeded of episodes", "success [%] (interval)"]
    columns += [] if main is None else [f"median {metric_title(main)} (interval)"]
    confidence = percentage_text(content.description.confidence, 0)
    caption = f"Intervals of {confidence}. A failure is worse than any value."
    return Table("answer", caption, (*columns, "most frequent failure"), tuple(rows))


def answer_sentences(content: ReportContent) -> tuple[str, ...]:
    """Returns the shown differences, one line for all others, and the lines on robustness.

    With many methods, the differences have one line per metric.
    """
    comparisons = content.analysis.comparisons
    robustness = () if content.robustness is None else robustness_sentences(content.robustness)
    if not comparisons:
        return (*content.analysis.sentences, *robustness)
    won = [item for item in comparisons if item.verdict in (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)]
    lines = [item.sentence for item in won]
    if len(content.analysis.methods) > MAX_PAIRED_METHODS:
        lines = [
            line
            for metric in content.metrics
            for line in _difference_lines([i for i in won if i.metric == metric.name])
        ]
    counts = {verdict: sum(item.verdict is verdict for item in comparisons) for verdict in Verdict}
    unshown = [
        (counts[Verdict.NOT_SHOWN], "no difference shown"),
        (counts[Verdict.NOT_SHOWABLE], _not_showable(comparisons)),
        (counts[Verdict.NO_DATA], "nothing to compare"),
    ]
    parts = [
        f"{text} in {number:,} of {count_phrase(len(comparisons), 'comparison')}" for number, text in unshown if number
    ]
    return (*lines, *(["; ".join(parts)] if parts else []), *robustness)


def _difference_lines(items: Sequence[Comparison]) -> list[str]:
    """Returns the shown differences in a metric; methods that are better than the same others share a line."""
    wins: dict[str, dict[str, float]] = {}
    for item in items:
        pair = (item.first, item.second) if item.verdict is Verdict.FIRST_BETTER else (item.second, item.first)
        wins.setdefault(pair[0], {})[pair[1]] = 100.0 * abs(item.difference.value if item.difference else 0.0)
    groups: dict[tuple[str, ...], list[str]] = {}
    for better, beaten in wins.items():
        groups.setdefault(tuple(beaten), []).append(better)
    lines = []
    for others, methods in groups.items():
        points = [wins[better][other] for better in methods for other in others]
        span = f"{min(points):.0f} to {max(points):.0f}" if len(points) > 1 else f"{points[0]:.0f}"
        verb = "is" if len(methods) == 1 else "are"
        lines.append(
            f"{spaced_words(items[0].metric)}: {enumeration(methods)} {verb} better than {enumeration(others)} in more "
            f"pairs than worse (+{span} points)"
        )
    return lines


def _not_showable(comparisons: Sequence[Comparison]) -> str:
    units = {item.counts.units for item in comparisons if item.verdict is Verdict.NOT_SHOWABLE}
    if not units:
        return ""
    span = f"{min(units)}" if len(units) == 1 else f"{min(units)} to {max(units)}"
    noun = next(item.unit_noun for item in comparisons if item.verdict is Verdict.NOT_SHOWABLE)
    return f"no difference could have been shown with {span} {noun}{'' if units == {1} else 's'}"


def _better_than_all(comparisons: Sequence[Comparison], methods: Sequence[str]) -> str | None:
    wins = {method: 0 for method in methods}
    for item in comparisons:
        if item.verdict is Verdict.FIRST_BETTER:
            wins[item.first] += 1
        elif item.verdict is Verdict.SECOND_BETTER:
            wins[item.second] += 1
    return next((method for method, count in wins.items() if len(methods) > 1 and count == len(methods) - 1), None)


def metric_title(metric: Metric) -> str:
    """Returns the name of a metric with unit, clock, source, and an arrow to the better values."""
    arrow = "↑" if metric.better.value == "higher" else "↓"
    unit = "%" if metric.is_fraction else metric.unit
    notes = [unit, *([metric.clock.value] if metric.clock else [])]
    notes += [metric.source.value] if metric.source is Source.SAID else []
    noted = ", ".join(filter(None, notes))
    return f"{spaced_words(metric.name)}{f' [{noted}]' if noted else ''}{NO_BREAK}{arrow}"


def _estimate(summary: MethodSummary | None) -> Estimate | None:
    return summary.estimate if summary else None


def estimate_text(estimate: Estimate | None, metric: Metric) -> str:
    """Returns an estimate with its interval, without unit; a rate is in percent."""
    if estimate is None:
        return NO_VALUE
    scale, unit = (100.0, "%") if metric.is_fraction else (1.0, metric.unit)
    if estimate.interval is None:
        return number_text(scale * estimate.value, unit=unit)
    return interval_text(scale * estimate.value, scale * estimate.interval.low, scale * estimate.interval.high, unit)


def wins_text(comparison: Comparison) -> str:
    """Returns the win difference of a comparison in points with its interval."""
    return estimate_text(comparison.difference, SUCCESS_METRIC)


def pairs_text(counts: PairCounts) -> str:
    """Returns the number of compared pairs and of their units."""
    if not counts.pairs:
        return NO_VALUE
    units = f" of {counts.units:,} units" if counts.units < counts.pairs else ""
    return f"{counts.pairs:,}{units}{' at random' if counts.at_random else ''}"


def shown_text(comparisons: Sequence[Comparison]) -> str:
    """Returns the shown differences between methods in a metric."""
    shown_texts = []
    for item in comparisons:
        match item.verdict:
            case Verdict.FIRST_BETTER:
                shown_texts.append(f"{item.first} better than {item.second}")
            case Verdict.SECOND_BETTER:
                shown_texts.append(f"{item.second} better than {item.first}")
            case Verdict.NOT_SHOWN | Verdict.NOT_SHOWABLE | Verdict.NO_DATA:
                continue
    if shown_texts:
        return "; ".join(shown_texts)
    verdicts = {item.verdict for item in comparisons}
    if Verdict.NOT_SHOWN in verdicts:
        return "no difference shown"
    return "could not be shown" if Verdict.NOT_SHOWABLE in verdicts else NO_VALUE


def method_table(content: ReportContent, component: str) -> Table:
    """Returns the figures of each method for the metrics of a component."""
    metrics = [metric for metric in content.metrics if metric.component == component]
    rows = [
        _method_row(metric, item)
        for metric in metrics
        for item in content.analysis.summaries
        if item.metric == metric.name
    ]
    columns = (
        "metric", "method", "rate or median (interval)", "quartiles", "mean", "counted", "units", "at the limit",
        "missing",
    )  # fmt: skip
    caption = f"Methods by the metrics of {spaced_words(component)}."
    return Table(f"methods_{component}", caption, columns, tuple(rows), tuple(_needed_episodes(content, metrics)))


def _method_row(metric: Metric, item: MethodSummary) -> tuple[Cell, ...]:
    low, high = item.quartiles or (None, None)
    scale, unit = (100.0, "%") if metric.is_fraction else (1.0, metric.unit)
    ends = [number_text(None if end is None else scale * end, unit=unit) for end in (low, high)]
    figures = number_cells(
        estimate_text(item.estimate, metric),
        f"{ends[0]} to {ends[1]}" if item.quartiles else NO_VALUE,
        estimate_text(item.mean, metric),
        count_text(item.counts.counted),
        count_text(item.counts.units),
        count_text(item.counts.censored) if metric.limit is not None else NO_VALUE,
        count_text(item.counts.missing),
    )
    return (Cell(metric_title(metric)), Cell(item.method), *figures)


def comparison_table(content: ReportContent, component: str) -> Table:
    """Returns the comparisons of each pair of methods for the metrics of a component."""
    metrics = {metric.name: metric for metric in content.metrics if metric.component == component}
    items = [item for item in content.analysis.comparisons if item.metric in metrics]
    rows = tuple(_comparison_row(metrics[item.metric], item) for item in items)
    columns = (
        "metric", "methods", "won", "lost", "won − lost [points] (interval)", "p corrected", "mean difference", "pairs",
        "result",
    )  # fmt: skip
    tests = dict.fromkeys(f"{item.test}; {item.correction}" for item in items if item.p_value is not None)
    intervals = dict.fromkeys(
        item.difference.interval.method for item in items if item.difference and item.difference.interval
    )
    notes = [f"{title}: {'; '.join(texts)}." for title, texts in (("Tests", tests), ("Intervals", intervals)) if texts]
    notes += dict.fromkeys(
        f"{spaced_words(item.metric)}, {item.first} and {item.second}: {note}" for item in items for note in item.notes
    )
    return Table(
        f"comparisons_{component}",
        f"Pairs of methods by the metrics of {spaced_words(component)}.",
        columns,
        rows,
        tuple(notes),
    )


def _comparison_row(metric: Metric, item: Comparison) -> tuple[Cell, ...]:
    match item.verdict:
        case Verdict.FIRST_BETTER:
            result = Cell(f"{item.first} better", True)
        case Verdict.SECOND_BETTER:
            result = Cell(f"{item.second} better", True)
        case Verdict.NOT_SHOWN:
            result = Cell("no difference shown" + (f"; {item.pairs_needed:,} pairs would" if item.pairs_needed else ""))
        case Verdict.NOT_SHOWABLE:
            needed = f"; {item.pairs_needed:,} pairs would" if item.pairs_needed else ""
            result = Cell(f"could not be shown with {count_phrase(item.counts.units, item.unit_noun)}{needed}")
        case Verdict.NO_DATA:
            result = Cell("nothing to compare")
    figures = number_cells(
        count_text(item.counts.won),
        count_text(item.counts.lost),
        wins_text(item),
        p_value_text(item.p_corrected),
        estimate_text(item.mean_difference, metric),
        pairs_text(item.counts),
    )
    return (Cell(metric_title(metric)), Cell(f"{item.first}, {item.second}"), *figures, result)


def missing_table(content: ReportContent) -> Table:
    """Returns the numbers of missing and censored values per metric and method."""
    rows = []
    for metric in content.metrics:
        for item in content.analysis.summaries:
            if item.metric != metric.name:
                continue
            counts, limit = item.counts, metric.limit is not None
            numbers = number_cells(
                count_text(counts.episodes),
                count_text(counts.counted - counts.censored),
                count_text(counts.censored) if limit else NO_VALUE,
                count_text(counts.missing),
                percentage_text(counts.unmeasured_share),
            )
            rows.append((Cell(metric_title(metric)), Cell(item.method), *numbers))
    columns = ("metric", "method", "episodes", "with a value", "at the limit", "missing", "without a value")
    caption = "Missing and censored values: every excluded value is counted here."
    return Table("missing", caption, columns, tuple(rows))


def status_table(content: ReportContent) -> Table:
    """Returns the numbers of each method's episodes by final status."""
    columns = ("method", "episodes", "succeeded", "failed", "timed out", "broken", "invalid")
    names = [column.replace(" ", "_") for column in columns[1:]]
    rows = tuple(
        (Cell(item.method), *number_cells(*(count_text(getattr(item.counts, name)) for name in names)))
        for item in content.analysis.summaries
        if item.metric == SUCCESS
    )
    return Table("statuses", "Final status of the finished episodes.", columns, rows)


def levels_table(content: ReportContent) -> Table:
    """Returns the success of each method at each level of the other factors."""
    metric = next(item for item in content.metrics if item.name == SUCCESS)
    rows = tuple(
        (
            Cell(level_words(item.levels)),
            Cell(item.method),
            *number_cells(
                estimate_text(item.estimate, metric),
                count_text(item.counts.succeeded),
                count_text(item.counts.counted),
            ),
        )
        for item in content.levels
    )
    columns = ("level", "method", "success [%] (interval)", "successes", "episodes")
    return Table("levels", "Success of each method at each level of the other factors.", columns, rows)


def spans_table(content: ReportContent, kind: str) -> Table:
    """Returns the time of each state or component.

    Args:
        content: Content of the report.
        kind: `state` or `component`.
    """
    rows = tuple(
        (
            Cell(item.name),
            Cell(item.method),
            *number_cells(*map(count_text, (item.runs, item.failed, item.unended))),
            *number_cells(*map(number_text, (item.mean_s, item.per_episode_s))),
        )
        for item in content.spans
        if item.kind == kind
    )
    columns = (kind, "method", "runs", "failed", "never ended", "mean [s]", "mean per episode [s]")
    caption = f"Real time of each {kind}; the mean per episode counts concurrent work once."
    return Table(f"spans_{kind}", caption, columns, rows)
