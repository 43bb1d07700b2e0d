# SPDX-License-Identifier: BSD-3-Clause
"""Writes the faults of a benchmark as a table into a page of docs/reference, or updates the table there."""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

TITLES = ("fault", "first named by", "text", "after [s]: median, worst", "goal under way", "back after [s]")


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRow:
    """Result of one fault; None where there is no figure, "" where there is nothing to report.

    Attributes:
        name: Fault.
        channel: ROS interface that named the cause first.
        text: Text that named the cause.
        goal: End of the goal that ran during the fault.
        named_s: Time until the cause was named, median of the repetitions [s].
        named_max_s: Longest time until the cause was named [s].
        back_s: Time from the end of the fault until the device is usable again, median [s].
        moved: Maximum joint motion after the fault [rad].
        right: Whether the row meets all requirements.
    """

    name: str
    channel: str = ""
    text: str = ""
    goal: str = ""
    named_s: float | None = None
    named_max_s: float | None = None
    back_s: float | None = None
    moved: float | None = None
    right: bool = False


def summary(rows: Sequence[FaultRow]) -> FaultRow:
    """Combines the repetitions of a fault; the text is that of the first wrong repetition, if any."""

    def known(values: Iterable[float | None]) -> list[float]:
        return [value for value in values if value is not None]

    named_s, back_s = known(row.named_s for row in rows), known(row.back_s for row in rows)
    return replace(
        next((row for row in rows if not row.right), rows[0]),
        named_s=statistics.median(named_s) if named_s else None,
        named_max_s=max(named_s, default=None),
        back_s=statistics.median(back_s) if back_s else None,
        moved=max(known(row.moved for row in rows), default=None),
        right=all(row.right for row in rows),
    )


def printed(row: FaultRow) -> str:
    """Returns a row as one line for the terminal."""
    figures = "  ".join(
        f"{title} {'      -' if value is None else f'{value:7.3f}'}"
        for title, value in (
            ("named", row.named_s),
            ("max", row.named_max_s),
            ("back", row.back_s),
            ("moved", row.moved),
        )
    )
    end = f" | goal: {row.goal}" if row.goal else ""
    return f"{'ok ' if row.right else 'NOT'} {row.name:52} {figures}  {row.channel or '-'}: {row.text}{end}"


def fault_table(rows: Iterable[FaultRow], moved_title: str) -> str:
    """Returns the rows as a table in Markdown.

    Args:
        rows: Faults.
        moved_title: Title of the column `moved`.
    """

    def number(value: float | None, digits: int) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    titles = (*TITLES, f"{moved_title} [rad]")
    lines = [f"| {' | '.join(titles)} |", "|" + "---|" * len(titles)]
    for row in rows:
        named = ", ".join(filter(None, (number(row.named_s, 3), number(row.named_max_s, 3))))
        text = re.sub(r"127\.\d+\.\d+\.\d+", "ADDRESS", row.text).removeprefix("hardware fault: ")
        text = re.sub(r"(joint '[^']+': [^;]+)(; joint '[^']+': [^;]+)+", r"\1; ...", text)  # one joint is enough
        cells = (row.name, row.channel, text, named, row.goal, number(row.back_s, 2), number(row.moved, 3))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def put_table(file: Path, name: str, text: str) -> None:
    """Writes a table between the two marks of that name in a file, or as a file of its own if there are none."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, mark, rest = (file.read_text() if file.exists() else "").partition(begin)
    after = rest.partition(end)[2] if mark else ""
    file.write_text(f"{before}{begin}\n{text}{end}{after or chr(10)}" if mark else text)
