# SPDX-License-Identifier: BSD-3-Clause
"""Renders a report as a self-contained HTML page that needs no network."""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from modular_framework_benchmark.reports import number_text
from modular_framework_benchmark.reports.figure_style import NamedFigure, spaced_words
from modular_framework_benchmark.reports.report_content import ReportContent, machine_readable
from modular_framework_benchmark.reports.robustness_figures import FIGURE_PREFIX
from modular_framework_benchmark.reports.robustness_tables import robustness_tables
from modular_framework_benchmark.reports.tables import (
    Cell,
    answer_sentences,
    answer_table,
    comparison_table,
    levels_table,
    method_table,
    missing_table,
    overview_table,
    spans_table,
    status_table,
)

SECTIONS = (
    ("comparison", "Comparison"), ("robustness", "Robustness"), ("components", "By component"),
    ("missing", "Missing values"),
    ("levels", "Other factors"), ("timelines", "Time"), ("failures", "Failures"),
    ("progress", "Progress"), ("run", "What was run"), ("words", "How to read this page"),
)  # fmt: skip


def report_page(content: ReportContent, database: str) -> str:
    """Returns the page of a report.

    Args:
        content: Content of the report.
        database: Database as named by the user.
    """
    figures = {figure.name: figure for figure in content.figures}
    parts = (
        ("robustness", content.robustness),
        ("levels", content.levels),
        ("timelines", content.spans),
        ("progress", not content.is_table),
    )
    absent = {name for name, part in parts if not part}
    return render_page(
        "report.html.jinja",
        machine_readable(content),
        content.figures,
        content=content,
        database=database,
        figures=figures,
        answer=answer_sentences(content),
        sections=[section for section in SECTIONS if section[0] not in absent],
        components=[_component(content, name) for name in content.components],
        robustness_figures=[figure for figure in content.figures if figure.name.startswith(FIGURE_PREFIX)],
        robustness_tables=robustness_tables(content),
        tables={
            "answer": answer_table(content),
            "overview": overview_table(content),
            "statuses": status_table(content),
            "missing": missing_table(content),
            "levels": levels_table(content),
            "states": spans_table(content, "state"),
            "components": spans_table(content, "component"),
        },
    )


def _as_sentence(text: str) -> str:
    """Returns a text as a sentence with a full stop; a leading method name keeps its case."""
    start = text[:1].upper() if text.startswith(("no ", "nothing ")) else text[:1]
    return start + text[1:] + ("" if text.endswith(".") else ".")


def _component(content: ReportContent, name: str) -> dict[str, object]:
    title = {"task": "Whole task", "grasp": "Grasp"}.get(name, spaced_words(name).capitalize())
    return {
        "title": title,
        "metrics": [metric for metric in content.metrics if metric.component == name],
        "methods": method_table(content, name),
        "comparisons": comparison_table(content, name),
        "figures": [figure for figure in content.figures if figure.component == name],
    }


def render_page(template: str, data: Mapping[str, Any], shown_figures: Sequence[NamedFigure], **values: object) -> str:
    """Returns a page from a template.

    Args:
        template: File name in the folder of templates.
        data: JSON values embedded for programs.
        shown_figures: Figures that the page may show.
        values: Values of the template's variables.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    environment.filters.update(
        words=spaced_words,
        in_groups=_in_groups,
        as_sentence=_as_sentence,
        base64=lambda text: base64.b64encode(text.encode()).decode(),
        count=number_text.count_text,
        counted=number_text.count_phrase,
        moment=number_text.moment_text,
        duration=number_text.duration_text,
        share=number_text.percentage_text,
    )
    data_json = _in_script(json.dumps(data, allow_nan=False, ensure_ascii=False))
    drawings = ",".join(f"{json.dumps(item.name)}:{item.figure.to_json()}" for item in shown_figures)
    figures_json = _in_script(f"{{{drawings}}}")
    return environment.get_template(template).render(
        values,
        style=Markup((Path(__file__).parent / "templates" / "style.css").read_text(encoding="utf-8")),
        plotly_js=Markup(get_plotlyjs()),
        data_json=data_json,
        figures_json=figures_json,
        nonce=hashlib.sha256(f"{data_json}{figures_json}".encode()).hexdigest()[:32],
    )


def _in_script(text: str) -> Markup:
    """Returns JSON escaped for a script element, so that no text ends the element."""
    for letter in ("<", ">", "&", "\u2028", "\u2029"):
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(text)


def _in_groups(rows: Sequence[tuple[Cell, ...]]) -> list[list[tuple[Cell, ...]]]:
    """Returns the rows grouped by equal heading of adjacent rows."""
    return [list(group) for _, group in itertools.groupby(rows, key=lambda row: row[0].text)]
