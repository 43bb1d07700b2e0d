# SPDX-License-Identifier: BSD-3-Clause
"""Writes the faults of a benchmark as a table into a page of docs/reference, or updates the table there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One fault; None where there is no such figure.

    Attributes:
        name: of the fault.
        text: what the user reads.
        reported_s: median time until it was reported [s].
        reported_max_s: longest [s].
        back_s: median time from its end until the device was usable again [s].
        moved: how far a joint moved after the fault [rad].
    """

    name: str
    text: str
    reported_s: float | None
    reported_max_s: float | None
    back_s: float | None
    moved: float | None


def fault_table(rows: Iterable[FaultRow], moved_title: str) -> str:
    """The rows as a table in Markdown.

    Args:
        rows: the faults.
        moved_title: what `moved` is.
    """

    def number(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    lines = [
        f"| fault | what the user reads | reported after [s]: median, worst | back after [s] | {moved_title} [rad] |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        reported = ", ".join(filter(None, (number(row.reported_s, 3), number(row.reported_max_s, 3))))
        text = re.sub(r"127\.\d+\.\d+\.\d+", "ADDRESS", row.text).removeprefix("hardware fault: ")
        lines.append(f"| {row.name} | {text} | {reported} | {number(row.back_s, 2)} | {number(row.moved, 3)} |")
    return "\n".join(lines) + "\n"


def put_table(file: Path, name: str, text: str) -> None:
    """Writes a table between the two marks of that name in a file, or as a file of its own if there are none."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, mark, rest = (file.read_text() if file.exists() else "").partition(begin)
    after = rest.partition(end)[2] if mark else ""
    file.write_text(f"{before}{begin}\n{text}{end}{after or chr(10)}" if mark else text)
