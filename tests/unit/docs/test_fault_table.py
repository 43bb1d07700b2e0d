# SPDX-License-Identifier: BSD-3-Clause
"""The tables of faults in docs/reference are updated by their benchmarks, each between its own marks."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from fault_table import FaultRow, fault_table, put_table, summary  # noqa: E402

ROWS = (
    FaultRow(
        name="cable pulled",
        channel="/diagnostics",
        text="127.3.2.1 lost",
        goal="aborted with this text",
        named_s=0.0123,
        named_max_s=0.5,
        back_s=1.236,
        moved=0.004,
        right=True,
    ),
    FaultRow(name="late answers", text="nothing to name", goal="goal reached", right=True),
)
HEAD = (
    "| fault | first named by | text | after [s]: median, worst | goal under way | back after [s] | moves [rad] |\n"
    "|---|---|---|---|---|---|---|\n"
)


def test_a_row_has_its_figures_and_no_address_of_the_emulator() -> None:
    assert fault_table(ROWS, "moves") == HEAD + (
        "| cable pulled | /diagnostics | ADDRESS lost | 0.012, 0.500 | aborted with this text | 1.24 | 0.004 |\n"
        "| late answers |  | nothing to name |  | goal reached |  |  |\n"
    )


def test_repetitions_have_medians_and_the_worst_and_are_wrong_if_one_is_wrong() -> None:
    runs = [
        FaultRow(name="cut", text="lost", named_s=0.1, back_s=1.0, moved=0.0, right=True),
        FaultRow(name="cut", text="not named", right=False),
        FaultRow(name="cut", text="lost", named_s=0.3, back_s=2.0, moved=0.2, right=True),
        FaultRow(name="cut", text="lost", named_s=0.2, back_s=4.0, moved=0.1, right=True),
    ]
    assert summary(runs) == FaultRow(
        name="cut", text="not named", named_s=0.2, named_max_s=0.3, back_s=2.0, moved=0.2, right=False
    )


def test_a_table_replaces_the_one_between_its_marks_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "README.md"
    file.write_text(
        "before\n<!-- arm: begin -->\nold\n<!-- arm: end -->\n<!-- hand: begin -->\n<!-- hand: end -->\nafter\n"
    )
    put_table(file, "hand", "new\n")
    put_table(file, "hand", "newer\n")
    assert file.read_text() == (
        "before\n<!-- arm: begin -->\nold\n<!-- arm: end -->\n<!-- hand: begin -->\nnewer\n<!-- hand: end -->\nafter\n"
    )
    put_table(tmp_path / "alone.md", "hand", "new\n")
    assert (tmp_path / "alone.md").read_text() == "new\n"
