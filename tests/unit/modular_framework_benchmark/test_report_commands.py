# SPDX-License-Identifier: BSD-3-Clause
"""Tables and figures for a paper, and two runs of an experiment compared, by the commands a user types."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_pages import Loads, Page
from reported_experiment import ReportedExperiment

from modular_framework_benchmark.commands.compare_command import main as compare
from modular_framework_benchmark.commands.report_command import main as report
from modular_framework_benchmark.records.results import COLD_START, WORKER_COUNT
from modular_framework_benchmark.results.database import open_database
from modular_framework_ros.reported_figures import Clock

RUN = ReportedExperiment(trials=24, with_files=False, with_spans=False)
SMALL = replace(RUN, trials=4)
WORSE = (("rrt_connect", 0.45, 0.4), *RUN.planners[1:])


def stored(folder: Path, name: str, experiment: ReportedExperiment = SMALL) -> str:
    return str(experiment.store(folder / name))


def test_the_markdown_table_has_the_cells_of_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored(tmp_path, "results.db")
    assert report([path, "--table", "markdown"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    cells = [[cell.strip().replace("\\", "").strip("*") for cell in line.strip("|").split("|")] for line in lines]
    assert cells[0][1:4] == ["rrt_connect", "bitstar", "stomp"]
    shown = Page.of(Path(path), tmp_path / "report.html").rows("overview")
    assert [row[1:4] for row in cells[2:]] == [row[1:4] for row in shown]


def test_the_latex_table_escapes_names_and_is_complete(tmp_path: Path) -> None:
    planners = (("a_b & c", 0.9, 0.4), ("50% #1 ~{x}^2\\", 0.8, 0.4))
    path = stored(tmp_path, "results.db", replace(SMALL, planners=planners))
    assert report([path, "--table", "latex", "--into", str(tmp_path / "table.tex")]) == 0
    text = (tmp_path / "table.tex").read_text()
    body = text[text.index("\\midrule") : text.index("\\bottomrule")]
    rows = [line for line in body.splitlines() if line.rstrip().endswith("\\\\")]
    assert len(rows) == 7
    assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {3}
    head = next(line for line in text.splitlines() if "metric" in line and "&" in line)
    assert r"a\_b \& c" in head and r"50\% \#1" in head
    assert not re.search(r"(?<!\\)[#%_]", head)
    assert text.count("\\begin{") == text.count("\\end{")


def test_figures_are_listed_and_written_as_png_and_pdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored(tmp_path, "results.db")
    assert report([path, "--figure", "list"]) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert {"ranking", "differences", "distribution_path_length"} <= set(names)
    for name, ending, first in (("ranking", ".png", b"\x89PNG"), ("distribution_path_length", ".pdf", b"%PDF")):
        into = tmp_path / f"image{ending}"
        assert report([path, "--figure", name + ending, "--into", str(into)]) == 0
        assert into.read_bytes().startswith(first)
        assert into.stat().st_size > 5_000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--figure", "rankin"), "ranking, differences"),
        (("--figure", "ranking.svg"), "png, pdf"),
        (("--figure", "ranking", "--table", "latex"), "remove one of them"),
    ],
)
def test_what_cannot_be_drawn_is_named_with_what_can(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert report([stored(tmp_path, "results.db"), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_without_a_browser_the_error_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROWSER_PATH", str(tmp_path / "absent"))
    assert report([stored(tmp_path, "results.db"), "--figure", "ranking"]) == 2
    assert "apt-get install chromium" in capsys.readouterr().err


def test_the_same_episodes_show_no_change_and_are_all_pairs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [stored(tmp_path, name) for name in ("before.db", "after.db")]
    assert compare([*paths, "--fail-on-regression"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("0 metrics of methods got worse, 0 better")
    assert "24 pairs of episodes" in said


def test_a_planner_that_got_worse_is_found_and_fails_the_comparison(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = stored(tmp_path, "before.db", RUN)
    after = stored(tmp_path, "after.db", replace(RUN, planners=WORSE))
    page = tmp_path / "changes.html"
    assert compare([before, after, "--fail-on-regression", "--into", str(page)]) == 1
    said = capsys.readouterr().out
    worse = [line.split() for line in said.splitlines() if line.endswith("worse")]
    assert ["rrt_connect", "success"] in [line[:2] for line in worse]
    assert all(line[0] == "rrt_connect" for line in worse)
    text = page.read_text()
    loads = Loads()
    loads.feed(text)
    assert loads.addresses == []
    assert "rrt_connect" in text and "worse" in text
    assert compare([after, before, "--fail-on-regression"]) == 0  # the other way round it got better
    assert not re.match(r"\d+ metrics of methods got worse, 0 better", capsys.readouterr().out)


def stored_with_block(
    path: Path, block: int, delay_s: float = 0.0, *, starts_known: bool = True, workers: int = 0
) -> str:
    """Stores an experiment whose planning takes 0.1 s longer in the first episode of a stack, as after a cold start.

    Args:
        path: Database.
        block: Trials for which a stack is kept; the next trial has another method, and then a stack of its own.
        delay_s: Time that planning takes longer in every episode [s].
        starts_known: Whether the records say which episodes were the first of their stack.
        workers: Workers on the machine; 0: the records do not say.
    """
    description = RUN.description()
    timed = tuple(
        replace(metric, clock=Clock.WALL) if metric.name == "planning_time" else metric
        for metric in description.metrics
    )
    noise = np.random.default_rng(block)
    with open_database(path, create=True) as database:
        number = database.add_experiment(replace(description, metrics=timed), RUN.specs())
        for record in RUN.records():
            cold = record.spec.trial % block == 0
            planning_s = 0.2 + 0.1 * cold + delay_s + noise.normal(0.0, 0.01)
            snapshot = {**record.snapshot, **({COLD_START: True} if cold and starts_known else {})}
            snapshot |= {WORKER_COUNT: workers} if workers else {}
            metrics = {**record.metrics, "planning_time": planning_s}
            database.write(number, replace(record, metrics=metrics, snapshot=snapshot))
    return str(path)


def test_the_same_code_with_another_block_shows_no_change(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = stored_with_block(tmp_path / "before.db", 5)
    after = stored_with_block(tmp_path / "after.db", 2)
    assert compare([before, after, "--fail-on-regression"]) == 0, capsys.readouterr().out
    said = capsys.readouterr().out
    assert said.startswith("0 metrics of methods got worse, 0 better")
    assert "only between two first episodes of their stacks or two later episodes" in said


def test_cold_and_warm_starts_mixed_would_show_a_change_and_a_slower_planner_does(tmp_path: Path) -> None:
    before = stored_with_block(tmp_path / "before.db", 5, starts_known=False)
    mixed = stored_with_block(tmp_path / "mixed.db", 2, starts_known=False)
    assert compare([before, mixed, "--fail-on-regression"]) == 1
    slower = stored_with_block(tmp_path / "slower.db", 2, 0.05)
    assert compare([stored_with_block(tmp_path / "known.db", 5), slower, "--fail-on-regression"]) == 1


def test_the_same_code_with_more_workers_shows_no_change_of_real_times(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alone = stored_with_block(tmp_path / "alone.db", 5, workers=1)
    crowded = stored_with_block(tmp_path / "crowded.db", 5, 0.1, workers=4)
    assert compare([alone, crowded, "--fail-on-regression"]) == 0, capsys.readouterr().out
    said = capsys.readouterr().out
    assert "worker_count: before 1; after 4" in said
    assert "episodes with the same number of workers on the machine: 1 before, 4 after." in said
    assert "nothing to compare in" in said
    slower = stored_with_block(tmp_path / "slower.db", 5, 0.1, workers=1)
    unknown = stored_with_block(tmp_path / "unknown.db", 5, 0.1)
    assert compare([alone, slower, "--fail-on-regression"]) == compare([alone, unknown, "--fail-on-regression"]) == 1


def test_a_report_says_how_many_episodes_were_the_first_of_their_stack(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert report([stored_with_block(tmp_path / "results.db", 5), "--into", str(page)]) == 0
    count = sum(record.spec.trial % 5 == 0 for record in RUN.records())
    assert f"{count} of the episodes were the first of their stack" in page.read_text()


def test_a_restricted_mean_without_an_interval_says_how_many_episodes_it_needs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planners = (RUN.planners[0], *((name, 0.3, time_s) for name, _, time_s in RUN.planners[1:]))
    path = stored(tmp_path, "results.db", replace(RUN, trials=6, planners=planners))
    notes = Page.of(Path(path), tmp_path / "report.html").text
    printed = capsys.readouterr().out
    with open_database(path) as database:
        episodes = database.load(1).episodes
    succeeded = episodes.groupby("motion_planner")["success"].sum()
    few = succeeded[[planner for planner in ("bitstar", "stomp") if 0 < succeeded[planner] < 6]]
    assert len(few) == 2 and succeeded["rrt_connect"] >= 6
    # 6 successes are expected in 6 * 12 / k episodes, if 12 episodes have k
    needed = " and ".join(f"{math.ceil(6 * 12 / number)} episodes of {planner}" for planner, number in few.items())
    sentence = f"For an interval, the restricted mean of the task time needs about {needed}."
    assert sentence in printed.splitlines() and sentence in notes


def test_two_experiments_of_one_database_are_compared_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored(tmp_path, "results.db", replace(SMALL, name="monday"))
    stored(tmp_path, "results.db", replace(SMALL, name="tuesday"))
    assert compare([path, "--experiment", "monday", "--with", "tuesday"]) == 0
    assert "24 pairs of episodes" in capsys.readouterr().out
    assert compare([path, "--experiment", "monday"]) == 2
    assert "--with NAME" in capsys.readouterr().err


def test_experiments_without_a_common_method_are_not_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = stored(tmp_path, "before.db")
    after = stored(tmp_path, "after.db", replace(SMALL, planners=(("chomp", 0.5, 1.0), ("prm", 0.5, 1.0))))
    assert compare([before, after]) == 2
    assert "no method is in both experiments" in capsys.readouterr().err
