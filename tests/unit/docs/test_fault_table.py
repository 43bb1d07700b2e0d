# SPDX-License-Identifier: BSD-3-Clause
"""The tables of faults in docs/reference are updated by their benchmarks, each between its own marks."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from fault_table import FaultRow, fault_table, put_table  # noqa: E402

ROWS = (
    FaultRow("cable pulled", "link to 127.3.2.1 lost", 0.0123, 0.5, 1.236, 0.004),
    FaultRow("late answers", "endured", None, None, None, None),
)
HEAD = (
    "| fault | what the user reads | reported after [s]: median, worst | back after [s] | moves [rad] |\n"
    "|---|---|---|---|---|\n"
)


def test_a_row_has_its_figures_and_no_address_of_the_emulator() -> None:
    assert fault_table(ROWS, "moves") == HEAD + (
        "| cable pulled | link to ADDRESS lost | 0.012, 0.500 | 1.24 | 0.004 |\n| late answers | endured |  |  |  |\n"
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
