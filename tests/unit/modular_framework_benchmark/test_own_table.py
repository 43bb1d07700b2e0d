# SPDX-License-Identifier: BSD-3-Clause
"""A CSV table of another program is compared and reported like an experiment, and its faults are named with lines."""

from __future__ import annotations

from pathlib import Path

import pytest
from report_pages import Page

from modular_framework_benchmark.commands.command_line import main as mbf
from modular_framework_benchmark.results.own_table import TableError, read_table
from modular_framework_benchmark.statistics.analysis import analyse

HEADINGS = "method,problem,success,time [s] lower,clearance higher"


def rows_of(problems: int, lost: int = 0) -> list[str]:
    """Rows of two methods; `slow` takes longer, and fails in the first problems."""
    return [
        row
        for index in range(problems)
        for row in (f"fast,p{index},1,{1 + index},0.5", f"slow,p{index},{int(index >= lost)},{2 + index},")
    ]


def table(folder: Path, *rows: str, name: str = "mine.csv", headings: str = HEADINGS) -> Path:
    path = folder / name
    path.write_text("\n".join([headings, *rows]) + "\n")
    return path


def test_methods_are_compared_in_pairs_of_the_same_problem(tmp_path: Path) -> None:
    analysis = analyse(read_table(table(tmp_path, *rows_of(20))))
    (time,) = (item for item in analysis.comparisons if item.metric == "time")
    assert (time.counts.pairs, time.counts.won, time.counts.lost, time.unit_noun) == (20, 20, 0, "problem")
    assert any(sentence.startswith("fast more often has the lower time than slow") for sentence in analysis.sentences)


def test_repetitions_of_a_problem_are_pairs_of_one_unit(tmp_path: Path) -> None:
    analysis = analyse(read_table(table(tmp_path, *rows_of(10), *rows_of(10))))
    (time,) = (item for item in analysis.comparisons if item.metric == "time")
    assert (time.counts.pairs, time.counts.units) == (20, 10)


def test_the_page_shows_the_table_and_no_command_that_repeats_it(tmp_path: Path) -> None:
    page = Page.of(table(tmp_path, *rows_of(12, lost=4)), tmp_path / "page.html")
    assert "slow,p11,1,13" in page.words and "run_experiment" not in page.words and "Run it again" not in page.words
    assert "progress" not in [link.get("href").strip("#") for link in page.tree.xpath("//nav/a")]
    assert page.rows("overview")[0][1:3] == ["100 (74 to 100)", "67 (35 to 90)"]


def test_tables_with_other_orders_of_the_problems_form_pairs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = table(tmp_path, *rows_of(30))
    after = table(tmp_path, *reversed(rows_of(30, lost=20)), name="after.csv")
    assert mbf(["compare", str(before), str(after), "--fail-on-regression"]) == 1
    shown = capsys.readouterr().out
    assert "60 pairs of episodes with the same method" in shown
    assert mbf(["compare", str(before), str(before), "--fail-on-regression"]) == 0


@pytest.mark.parametrize(
    ("rows", "headings", "message"),
    [
        ((), HEADINGS, "mine.csv: the table has no rows"),
        (("a,p,1",), "method,problem,success,time [s]", "line 1: column 'time [s]'; allowed: method, problem, success"),
        (("a,1",), "method,success", "line 1: there is no column 'problem'; add the column"),
        (("a,p,1,1,1",), "method,problem,success,x lower,x higher", "line 1: metric 'x': the name is taken"),
        (("a,p,1,1",), "method,problem,success,success", "line 1: column 'success' is there twice"),
        (("a,p,yes,1,",), HEADINGS, "line 2: column 'success' has 'yes'; allowed: 1, true, 0, false"),
        (("a,p,1,1,", "a,p,1,fast,"), HEADINGS, "line 3: column 'time [s] lower' has 'fast'; allowed: a number"),
        ((",p,1,1,",), HEADINGS, "line 2: no value in column 'method'"),
        (("a,p,1,1,1,1",), HEADINGS, "line 2: 6 cells; allowed: 5"),
    ],
)
def test_a_fault_is_named_with_its_line(tmp_path: Path, rows: tuple[str, ...], headings: str, message: str) -> None:
    with pytest.raises(TableError) as error:
        read_table(table(tmp_path, *rows, headings=headings))
    assert message in str(error.value)


def test_an_unreadable_table_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "latin.csv").write_bytes("method,problème".encode("latin-1"))
    for name, message in (("missing.csv", "there is no such file"), ("latin.csv", "is not UTF-8")):
        assert mbf(["report", str(tmp_path / name)]) == 2
        assert f"{name}: {message}" in capsys.readouterr().err
    assert mbf(["report", str(table(tmp_path, *rows_of(6))), "--experiment", "other"]) == 2
    assert "--experiment has no effect" in capsys.readouterr().err


def test_an_unknown_command_is_refused_with_the_allowed_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert mbf(["reprot"]) == 2
    assert "got 'reprot'; allowed: report, compare, export" in capsys.readouterr().err
    assert mbf(["--help"]) == 0
