# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report says what was found and what was run, needs no network, and shows hostile texts as texts."""

from __future__ import annotations

import base64
import re
import sqlite3
import urllib.parse
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import html
from report_pages import Loads, Page, drawn_page
from reported_experiment import MILESTONES, TEXT, ReportedExperiment

from modular_framework_benchmark.commands.report_command import main
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.reports.failure_groups import EpisodeFiles, Link
from modular_framework_benchmark.reports.report_source import open_experiment
from modular_framework_benchmark.reports.span_tables import ChosenEpisode
from modular_framework_benchmark.reports.time_figures import timelines_figure
from modular_framework_benchmark.results.database import open_database
from modular_framework_testing.chromium import Chromium
from modular_framework_testing.ros_session import until

HOSTILE = (
    "<script>document.documentElement.dataset.hacked = 1</script>",
    '</script><img src=x onerror="document.documentElement.dataset.hacked = 2">',
    "' onmouseover='alert(3)' \u2028 <!-- {{ 7 * 7 }} {% raw %} %{x} <b>bold</b> &amp; $\\frac12$",
    "line one\nline two\ttab \x07 bell",
)
SMALL = ReportedExperiment(trials=14)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """The page of an experiment, which lies beside the folder of the database."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "data").mkdir()
    (folder / "pages").mkdir()
    return Page.of(SMALL.store(folder / "data" / "results.db"), folder / "pages" / "report.html")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """The page of an experiment whose causes and methods are hostile."""
    folder = tmp_path_factory.mktemp("hostile")
    planners = tuple(
        (f"{name} & co", chance, time_s) for name, chance, time_s in (("<b>a</b>", 0.5, 1.0), ("b\"'>", 0.6, 1.0))
    )
    experiment = ReportedExperiment(trials=14, planners=planners, objects=("<i>can</i>",), causes=HOSTILE)
    return Page.of(experiment.store(folder / "results.db"), folder / "report.html")


def test_the_first_screen_says_how_many_succeeded_who_is_better_and_where_they_failed(page: Page) -> None:
    rows = page.rows("answer")
    assert [row[0] for row in rows] == ["rrt_connect", "bitstar", "stomp"]
    for row, summary in zip(rows, page.claims["analysis"]["summaries"], strict=False):
        counts = summary["counts"]
        assert row[1] == f"{counts['succeeded']} of {counts['episodes']}"
        assert re.fullmatch(r"[\d.]+ \([\d.]+ to [\d.]+\)", row[2])
        assert re.match(r"\d+: ", row[4])
    paragraphs = [element.text_content() for element in page.tree.xpath("//section[@class='answer']/p")]
    shown = [item for item in page.claims["analysis"]["comparisons"] if item["verdict"].endswith("better")]
    assert len(paragraphs) <= len(shown) + 2
    not_shown = len(page.claims["analysis"]["comparisons"]) - len(shown)
    assert f"o difference shown in {not_shown} of 21 comparisons" in " ".join(paragraphs)
    assert "The unit is the scene: 28 scenes. Claims are about scenes like these, at the levels of object" in page.words
    assert page.words.index("succeeded") < page.words.index("Each metric by method")


def test_many_methods_are_ranked_in_one_figure_and_not_paired_in_prose(tmp_path: Path) -> None:
    planners = tuple((f"planner_{place}", 0.2 + 0.15 * place, 1.0) for place in range(5))
    experiment = replace(SMALL, trials=30, planners=planners, with_spans=False, with_files=False)
    page = Page.of(experiment.store(tmp_path / "results.db"), tmp_path / "report.html")
    figures = page.figures()
    assert list(figures["ranking"]["data"][0]["y"])[0] == "planner_4"
    assert "differences" not in figures
    paragraphs = page.tree.xpath("//section[@class='answer']/p")
    assert len(paragraphs) < 25
    assert re.search(r"success: planner_\d(, planner_\d)*( and planner_\d)? (is|are) better than planner_0", page.words)


def test_two_trials_print_values_and_one_line_for_all_that_could_not_be_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planners = tuple((f"planner_{place}", 1.0, 1.0) for place in range(10))
    experiment = replace(SMALL, trials=2, planners=planners, objects=("can",), with_spans=False, with_files=False)
    assert main([str(experiment.store(tmp_path / "results.db")), "--into", str(tmp_path / "report.html")]) == 0
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert len(lines) == 1 + 10 + 1 + 2
    assert re.search(r"planner_3 +\d of 2 +[\d.]+ ", printed)
    assert "(interval)" in lines[0] and " to " not in "".join(lines[1:11])
    assert re.match(r"no difference could have been shown with 1?.*2 scenes in \d+ of 315 comparisons", lines[12])


def test_it_says_how_many_of_the_planned_episodes_are_finished(page: Page) -> None:
    assert "84 of 84 episodes finished" in page.words


def test_the_overview_has_each_metric_of_each_method_with_its_interval(page: Page) -> None:
    rows = page.rows("overview")
    assert [row[0].split("\u00a0")[0].partition(" [")[0] for row in rows] == [
        "success", "task time", "candidates", "planning time", "path length", "tracking error", "slip",
    ]  # fmt: skip
    assert all(re.fullmatch(r"−?[\d.]+ \(−?[\d.]+ to (−?[\d.]+|failure)\)", cell) for row in rows for cell in row[1:4])


def test_missing_and_censored_values_are_counted_for_each_method(page: Page) -> None:
    rows = page.rows("missing")
    assert len(rows) == 7 * 3
    times = rows[3][1:]
    assert times[0] == "rrt_connect"
    assert int(times[2]) + int(times[3]) == 28
    assert times[4] == "0"


def test_the_experiment_file_stands_there_verbatim_and_can_be_saved(page: Page) -> None:
    assert TEXT in [element.text_content() for element in page.tree.xpath("//pre")]
    link = page.tree.xpath("//a[@download]")[0]
    assert urllib.request.urlopen(link.get("href")).read().decode() == TEXT  # a data address: nothing is fetched


def test_it_says_versions_machine_and_how_to_run_it_again(page: Page) -> None:
    for text in ("0f3c9d2", "lab-pc", "packages.ompl", "run_experiment planners_on_two_objects.yaml"):
        assert text in page.words


def test_each_failure_is_linked_to_its_files_relative_to_the_page(page: Page) -> None:
    links = page.tree.xpath("//details//td/a")
    assert {link.text_content().split()[0] for link in links} == {"folder", "log", "video"}
    for link in links:
        assert (page.path.parent / urllib.parse.unquote(link.get("href"))).exists()


def test_an_episode_with_a_record_of_its_task_has_the_command_that_replays_it(tmp_path: Path) -> None:
    for folder in ("episodes/1 a/task_records", "episodes/2"):
        (tmp_path / folder).mkdir(parents=True)
    files = EpisodeFiles(
        database="/lab/my picks.db", experiment="picks", database_folder=tmp_path, report_folder=tmp_path / "report"
    )
    opened = "rosrun modular_framework_ui page --replay '/lab/my picks.db' --experiment picks"
    assert files.links(1, "episodes/1 a")[-1] == Link("replay", command=f"{opened} --episode 1")
    assert files.class_link("no plan") == Link("replay", command=f"{opened} --failure-class 'no plan'")
    assert [link.text for link in files.links(2, "episodes/2")] == ["folder"] and files.class_link("") is None
    on_server = replace(files, database="postgresql://lab:***@host/picks")
    folder = tmp_path.resolve() / "episodes" / "1 a"
    command = f"rosrun modular_framework_ui page --replay '{folder}'"
    assert on_server.links(1, "episodes/1 a")[-1] == Link("replay", command=command)
    assert on_server.class_link("no plan") is None


def test_a_failure_class_has_the_command_that_lists_its_episodes_with_records(tmp_path: Path) -> None:
    experiment = replace(SMALL, with_progress=True)
    database = experiment.store(tmp_path / "results.db")
    for folder in (tmp_path / f"{experiment.name}_files").iterdir():
        (folder / "task_records").mkdir()
    page = Page.of(database, tmp_path / "report.html")
    found = [code.text_content() for code in page.tree.xpath("//details[summary/strong='slipped']/p//code")]
    command = f"{database} --experiment {experiment.name} --failure-class slipped"
    assert set(found) == {f"rosrun modular_framework_ui page --replay {command}"}


def test_a_selected_mark_shows_the_command_that_opens_its_episode_or_class(tmp_path: Path) -> None:
    experiment = replace(SMALL, with_progress=True)
    database = experiment.store(tmp_path / "results.db")
    for folder in (tmp_path / f"{experiment.name}_files").iterdir():
        (folder / "task_records").mkdir()
    page = Page.of(database, tmp_path / "report.html")
    figures = page.figures()
    with open_experiment(str(database), None) as opened:
        compared, episodes = opened.results.description.compared, opened.results.episodes.set_index("number")
    dots = [trace for trace in figures["distribution_planning_time"]["data"] if trace.get("meta") == "replay"]
    for trace, method in zip(dots, ("rrt_connect", "bitstar", "stomp"), strict=True):
        numbers = [int(option.removeprefix("--episode ")) for option in trace["customdata"]]
        assert set(episodes.loc[numbers, compared]) == {method}
        values = np.frombuffer(base64.b64decode(trace["x"]["bdata"]), trace["x"]["dtype"])
        assert values == pytest.approx(episodes.loc[numbers, "planning_time"].to_numpy())
        assert trace["text"] == [f"episode {number}" for number in numbers]
    assert {"--failure-class slipped"} <= set(figures["failures"]["data"][0]["customdata"])
    command = f"rosrun modular_framework_ui page --replay {database} --experiment {experiment.name}"
    with Chromium(page.path.as_uri()) as browser:
        until(lambda: browser.evaluate("document.documentElement?.dataset.drawn"), "the figures", 60.0)
        for name, option in (("distribution_planning_time", dots[0]["customdata"][0]), ("timelines", "--episode ")):
            browser.evaluate(
                f"""(() => {{ const place = document.querySelector('[data-figure="{name}"]');
                const data = place.data.find((trace) => trace.meta === 'replay');
                place.emit('plotly_click', {{ points: [{{ data, customdata: data.customdata[0] }}] }}); }})()"""
            )
            browser.shows(f"#figure-{name} .replay:not([hidden])", f"{command} {option}")


def test_a_mark_of_an_episode_without_a_record_shows_no_command(page: Page) -> None:
    marked = [trace for figure in page.figures().values() for trace in figure["data"] if trace.get("meta") == "replay"]
    assert {option for trace in marked for option in trace["customdata"]} == {""}
    assert "Select a dot" not in page.words and "Select a bar" not in page.words


def test_the_episodes_of_the_timelines_are_linked_to_their_files_successes_too(page: Page) -> None:
    (table,) = page.tree.xpath("//table[caption='The episodes of the timelines.']")
    rows = [[cell.text_content() for cell in row] for row in table.xpath("tbody/tr")]
    assert {status for _, _, status, _ in rows} >= {"succeeded", "failed"}
    assert all("video" in files for _, _, _, files in rows)
    for link in table.xpath(".//a"):
        assert (page.path.parent / urllib.parse.unquote(link.get("href"))).exists()


def test_a_timeline_says_that_its_episode_started_cold() -> None:
    spans = pd.DataFrame(
        [
            {"number": number, "kind": "state", "name": "/lift", "started_s": 0.0, "ended_s": 1.0}
            | {"failed": False, "reason": ""}
            for number in (1, 2)
        ]
    )
    chosen = [ChosenEpisode(number, "a", EpisodeStatus.SUCCEEDED, number == 1, ()) for number in (1, 2)]
    figure = timelines_figure(chosen, spans)
    assert figure is not None
    labels = figure.figure.layout.yaxis.ticktext
    assert "cold start" in labels[0] and "cold" not in labels[1]


def test_failures_have_classes_by_method_that_lead_to_the_files_of_their_episodes(tmp_path: Path) -> None:
    experiment = replace(SMALL, with_progress=True)
    page = Page.of(experiment.store(tmp_path / "results.db"), tmp_path / "report.html")
    records = [record for record in experiment.records() if not record.succeeded]
    expected: dict[str, dict[str, int]] = {}
    for record in records:
        of_class = expected.setdefault(record.snapshot["failure_class"], {})
        method = record.spec.configuration["motion_planner"]
        of_class[method] = of_class.get(method, 0) + 1
    assert page.claims["failures"]["classes"] == expected
    assert {group["failure_class"] for group in page.claims["failures"]["groups"]} == set(expected)
    summaries = [element.text_content().strip() for element in page.tree.xpath("//details/summary")]
    assert any(text.startswith("slipped: the object slipped") for text in summaries)
    assert page.tree.xpath("//details[summary/strong='slipped']//a[contains(@href, 'episode.log')]")


def test_the_report_shows_how_many_episodes_of_each_method_reached_each_milestone(tmp_path: Path) -> None:
    experiment = replace(SMALL, with_progress=True)
    page = Page.of(experiment.store(tmp_path / "results.db"), tmp_path / "report.html")
    for trace in page.figures()["milestones"]["data"]:
        records = [each for each in experiment.records() if each.spec.configuration["motion_planner"] == trace["name"]]
        reached = [
            sum(span.name == name and not span.failed for each in records for span in each.spans) for name in MILESTONES
        ]
        assert list(trace["x"]) == list(MILESTONES)
        assert [list(each) for each in trace["customdata"]] == [[number, len(records)] for number in reached]
        assert list(trace["y"]) == pytest.approx([100.0 * number / len(records) for number in reached])


def test_a_milestone_counts_only_the_episodes_whose_levels_have_it(tmp_path: Path) -> None:
    experiment = replace(SMALL, with_progress=True)
    first, *later = MILESTONES
    database = tmp_path / "results.db"
    records = [
        replace(record, spans=tuple(span for span in record.spans if span.name not in later))
        if record.spec.configuration["object"] == experiment.objects[0]
        else record
        for record in experiment.records()
    ]
    records[-1] = replace(records[-1], status=EpisodeStatus.BROKEN, spans=())  # without a record, at the second level
    with open_database(database, create=True) as opened:
        number = opened.add_experiment(experiment.description(), experiment.specs())
        for record in records:
            opened.write(number, record)
    figure = Page.of(database, tmp_path / "report.html").figures()["milestones"]
    for trace in figure["data"]:
        of_method = [each for each in records if each.spec.configuration["motion_planner"] == trace["name"]]
        of_level = [each for each in of_method if each.spec.configuration["object"] == experiment.objects[1]]
        assert [total for _, total in trace["customdata"]] == [len(of_method), *[len(of_level)] * len(later)]


def test_an_experiment_without_milestones_has_no_figure_of_them(page: Page) -> None:
    assert "milestones" not in page.figures() and "Failures by cause" in page.words


def test_failures_are_grouped_by_cause_most_frequent_first(page: Page) -> None:
    groups = page.claims["failures"]["groups"]
    assert [group["episodes"] for group in groups] == sorted((group["episodes"] for group in groups), reverse=True)
    assert sum(group["episodes"] for group in groups) == page.claims["failures"]["episodes"]
    assert all(group["cause"] in page.words for group in groups)


def test_a_broken_episode_is_named_before_the_figures(tmp_path: Path) -> None:
    page = Page.of(ReportedExperiment(trials=14, seed=10).store(tmp_path / "results.db"), tmp_path / "report.html")
    warning = page.tree.xpath("//section[@class='warning']")[0].text_content()
    broken = [number for number in re.findall(r"number ([\d, ]+)", warning)[0].split(", ")]
    assert len(broken) == sum(item["counts"]["broken"] for item in page.claims["analysis"]["summaries"][:3]) > 0


@pytest.mark.parametrize("which", ["page", "hostile"])
def test_nothing_is_loaded_from_a_network(which: str, request: pytest.FixtureRequest) -> None:
    page: Page = request.getfixturevalue(which)
    loads = Loads()
    loads.feed(page.text)
    assert loads.addresses == []
    assert not re.search(r"@import|url\s*\(", page.tree.xpath("//style")[0].text_content())
    policy = page.tree.xpath("//meta[@http-equiv='Content-Security-Policy']")[0].get("content")
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"https?:", policy)


def test_hostile_texts_are_shown_as_texts(hostile: Page) -> None:
    causes = [element.text_content() for element in hostile.tree.xpath("//td[@class='cause']")]
    for text in HOSTILE[:3]:
        assert text in causes
    assert [element.tag for element in hostile.tree.xpath("//img | //b | //*[@onmouseover] | //*[@onerror]")] == []
    assert "<b>a</b> & co" in hostile.words
    assert len(hostile.tree.xpath("//script")) == 4


def test_hostile_texts_in_figures_are_escaped_for_plotly(hostile: Page) -> None:
    drawn = "".join(value for value in _strings(hostile.figures()) if "co" in value or "script" in value)
    assert "&lt;b&gt;a&lt;/b&gt; &amp; co" in drawn
    assert not re.search(r"<(?!br>|extra>|/extra>)", drawn)


def _strings(value: object) -> list[str]:
    if isinstance(value, dict):
        return [text for inner in value.values() for text in _strings(inner)]
    if isinstance(value, list):
        return [text for inner in value for text in _strings(inner)]
    return [value] if isinstance(value, str) else []


def test_a_browser_draws_every_figure_without_a_network_and_runs_no_hostile_script(
    hostile: Page, tmp_path: Path
) -> None:
    drawn = html.document_fromstring(drawn_page(hostile.path, tmp_path))
    places = drawn.xpath("//*[@data-figure]")
    assert drawn.get("data-drawn") == str(len(places)) != "0"
    assert all(place.xpath(".//*[local-name()='svg']//*[local-name()='path']") for place in places)
    legends = drawn.xpath("//*[local-name()='g'][@class='legend']")
    assert legends
    for legend in legends:  # the toolbar is at the top
        (height,) = legend.xpath("ancestor::*[local-name()='svg'][1]/@height")
        _, top = legend.get("transform").removeprefix("translate(").removesuffix(")").split(",")
        assert float(top) > 0.5 * float(height)
    assert drawn.get("data-hacked") is None


def test_a_path_out_of_the_folder_of_the_database_is_no_link(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "secret_files").mkdir()
    experiment = ReportedExperiment(trials=4, with_files=False)
    path = experiment.store(tmp_path / "data" / "results.db")
    connection = sqlite3.connect(path)
    connection.execute("UPDATE records SET folder = '../secret_files'")
    connection.commit()
    connection.close()
    assert "secret_files" not in Page.of(path, tmp_path / "report.html").text


def test_an_experiment_without_a_finished_episode_has_a_page_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "results.db"
    ReportedExperiment(trials=4, finished=0).store(path)
    page = Page.of(path, tmp_path / "report.html")
    assert "0 of 24 planned episodes are finished" in page.words


def test_an_unfinished_experiment_says_so(tmp_path: Path) -> None:
    path = ReportedExperiment(trials=4, finished=10).store(tmp_path / "results.db")
    assert "10 of 24 planned episodes are finished" in Page.of(path, tmp_path / "report.html").words


def test_one_method_alone_is_reported(tmp_path: Path) -> None:
    experiment = replace(SMALL, trials=4, planners=(("only", 0.5, 1.0),), with_spans=False)
    page = Page.of(experiment.store(tmp_path / "results.db"), tmp_path / "report.html")
    assert len(page.rows("overview")) == 7


def test_components_without_a_task_have_times_but_no_timeline(tmp_path: Path) -> None:
    path = replace(SMALL, trials=4).store(tmp_path / "results.db")
    with sqlite3.connect(path) as connection:
        connection.execute("DELETE FROM spans WHERE kind = 'state'")
    page = Page.of(path, tmp_path / "report.html")
    assert {row[0] for row in page.rows("spans_component")} >= {"planning"}
    assert "components" in page.figures() and "timelines" not in page.figures()


@pytest.mark.parametrize(("planning_s", "limit", "lines"), [(4.0, "5 s, dotted", 2), (0.2, "5 s", 0)])
def test_a_limit_is_drawn_unless_it_is_so_far_off_that_it_squeezes_the_values(
    planning_s: float, limit: str, lines: int, tmp_path: Path
) -> None:
    experiment = replace(SMALL, trials=4, planners=(("one", 0.9, planning_s), ("other", 0.9, planning_s)))
    page = Page.of(experiment.store(tmp_path / "results.db"), tmp_path / "report.html")
    assert len(page.figures()["distribution_planning_time"]["layout"].get("shapes", ())) == lines
    assert f"Episodes at the limit ({limit})" in page.words


def test_several_experiments_need_a_name_and_a_wrong_name_gets_the_right_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "results.db"
    for name in ("first", "second"):
        ReportedExperiment(trials=2, name=name, with_files=False).store(path)
    assert main([str(path)]) == 2
    assert "first, second; name an experiment with --experiment" in capsys.readouterr().err
    assert main([str(path), "--experiment", "secnd"]) == 2
    assert "second" in capsys.readouterr().err
    assert main([str(path), "--experiment", "second", "--into", str(tmp_path / "page.html")]) == 0


def test_a_page_that_cannot_be_written_is_an_error_that_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ReportedExperiment(trials=2, with_files=False).store(tmp_path / "results.db")
    assert main([str(path), "--into", str(tmp_path / "absent" / "page.html")]) == 2
    assert "absent/page.html" in capsys.readouterr().err
