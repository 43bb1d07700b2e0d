# SPDX-License-Identifier: BSD-3-Clause
"""Tables for a paper: Markdown, and LaTeX with booktabs."""

from __future__ import annotations

import re

from modular_framework_benchmark.reports.tables import Cell, Table

_LATEX_ESCAPES = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': "''", "–": "--", "−": "$-$", "↑": r"$\uparrow$", "↓": r"$\downarrow$",
    "…": r"\dots{}", "±": r"$\pm$", "°": r"\textdegree{}", "µ": r"\textmu{}", "²": r"\textsuperscript{2}",
    "\u00a0": "~", "\n": " ", "\r": " ", "\t": " ",
}  # fmt: skip
_MARKDOWN_SPECIAL = re.compile(r"([\\`*_{}\[\]<>|#~&$])")


def markdown_table(table: Table) -> str:
    """Returns a table in GitHub's Markdown, with the caption above and the notes below."""
    lines = [markdown_text(table.caption), ""]
    lines.append("| " + " | ".join(markdown_text(title) for title in table.columns) + " |")
    is_numeric = [_is_number(table, column) for column in range(len(table.columns))]
    lines.append("|" + "|".join("---:" if numeric else "---" for numeric in is_numeric) + "|")
    lines += ["| " + " | ".join(_markdown_cell(cell) for cell in row) + " |" for row in table.rows]
    for note in table.notes:
        lines += ["", markdown_text(note)]
    return "\n".join(lines) + "\n"


def latex_table(table: Table) -> str:
    """Returns a LaTeX table that needs the package booktabs; the notes are comments."""
    columns = "".join("r" if _is_number(table, column) else "l" for column in range(len(table.columns)))
    body = [" & ".join(_latex_cell(cell) for cell in row) + r" \\" for row in table.rows]
    notes = [f"% {line}" for note in table.notes for line in note.splitlines()]
    lines = [
        r"% needs \usepackage{booktabs}",
        r"\begin{table}",
        r"  \centering",
        rf"  \caption{{{latex_text(table.caption)}}}",
        rf"  \label{{tab:{re.sub('[^A-Za-z0-9]', '-', table.name)}}}",
        rf"  \begin{{tabular}}{{{columns}}}",
        r"    \toprule",
        "    " + " & ".join(latex_text(title) for title in table.columns) + r" \\",
        r"    \midrule",
        *(f"    {line}" for line in body),
        r"    \bottomrule",
        r"  \end{tabular}",
        r"\end{table}",
        *notes,
    ]
    return "\n".join(lines) + "\n"


def latex_text(text: str) -> str:
    """Escapes a text for LaTeX."""
    return "".join(
        _LATEX_ESCAPES.get(letter, letter) for letter in text if letter.isprintable() or letter in _LATEX_ESCAPES
    )


def markdown_text(text: str) -> str:
    """Escapes a text for Markdown and joins its lines."""
    return _MARKDOWN_SPECIAL.sub(r"\\\1", " ".join(text.split()))


def _is_number(table: Table, column: int) -> bool:
    return bool(table.rows) and all(row[column].is_number for row in table.rows)


def _latex_cell(cell: Cell) -> str:
    text = latex_text(cell.text)
    return rf"\textbf{{{text}}}" if cell.is_strong else text


def _markdown_cell(cell: Cell) -> str:
    text = markdown_text(cell.text)
    return f"**{text}**" if cell.is_strong else text
