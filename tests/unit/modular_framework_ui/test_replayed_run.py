# SPDX-License-Identifier: BSD-3-Clause
"""The episodes of an experiment are listed, opened by number, and compared in pairs in simulated time."""

from __future__ import annotations

import json
import shutil
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recorded_files import BEGUN, write_episode, write_run
from websockets.sync.client import connect

from modular_framework_simulation.viewer.web_server import free_port
from modular_framework_testing.chromium import Chromium
from modular_framework_testing.ros_session import until
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.page_source import PageSource
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.recorded_run import Difference, RecordedRun, differences, read_run
from modular_framework_ui.recorded_task import ReplayError, read_task
from modular_framework_ui.replay_command import main, replay_source

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("run"))


@pytest.fixture
def run(database: Path) -> RecordedRun:
    return read_run(str(database), None)


@pytest.fixture
def server(database: Path) -> Iterator[PageServer]:
    server = PageServer(WEB, replay_source(str(database)), "127.0.0.1", free_port("127.0.0.1", 8990))
    server.start()
    yield server
    server.close()


def fetched(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=10.0) as answer:
        return bytes(answer.read())


def first_message(server: PageServer, query: str) -> dict[str, Any]:
    with connect(f"{server.address.replace('http:', 'ws:')}live?{query}", max_size=None) as browser:
        return dict(json.loads(browser.recv(timeout=20.0)))


def test_the_episodes_of_a_run_have_their_figures_and_partners(run: RecordedRun) -> None:
    assert (run.title, run.compared, run.planned, list(run.episodes)) == ("two_planners", "planner", 4, [0, 1, 2, 3])
    failed = run.episodes[0]
    assert (failed.method, failed.levels, failed.trial, failed.status) == ("rrt", "object can", 4, "failed")
    assert (failed.failure_class, failed.reason, failed.progress) == ("slipped", "the object fell", 0.5)
    assert [episode.partners for episode in run.episodes.values()] == [(1,), (0,), (3,), (2,)]


def test_an_episode_without_files_or_outside_of_the_folder_of_the_database_cannot_be_opened(
    run: RecordedRun, database: Path, tmp_path: Path
) -> None:
    with pytest.raises(ReplayError, match="episode 3 has no record of its task; allowed: episodes of mode task"):
        run.replayable(3)
    with pytest.raises(ReplayError, match="episode 9 is not among the finished episodes; allowed: 0 to 3"):
        run.replayable(9)
    inner = tmp_path / "inner"
    inner.mkdir()
    shutil.copy(database, inner)
    shutil.copytree(database.parent / "files", tmp_path / "outside")
    (inner / "files").symlink_to(tmp_path / "outside")
    assert read_run(str(inner / database.name), None).episodes[0].folder is None


def test_the_differences_of_a_pair_are_second_minus_first(run: RecordedRun) -> None:
    first, second = run.episodes[0], run.episodes[1]
    outcome, progress, time, failure_class, _ = differences(first, second)
    assert outcome == Difference(name="outcome", first="failed", second="succeeded", difference="different")
    assert (progress.first, progress.second, progress.difference) == ("50.0 %", "100.0 %", "+50.0 %")
    assert (time.first, time.second, time.difference) == ("–", "10.0 s", "–")
    assert (failure_class.first, failure_class.second) == ("slipped", "–")
    slower = replace(second, task_time_s=12.5)
    assert differences(second, slower)[2].difference == "+2.5 s"


def test_a_slow_simulation_does_not_stretch_simulated_time(tmp_path: Path) -> None:
    write_episode(tmp_path)
    (file,) = (tmp_path / "task_records").glob("*.json")
    content = json.loads(file.read_text())
    real_ends_s = [state["ended_s"] for state in content["states"]]
    for state in content["states"]:  # real time is three times as long as simulated time
        state["started_s"], state["ended_s"] = 3.0 * state["started_s"], 3.0 * state["ended_s"]
    file.write_text(json.dumps(content))
    (tmp_path / "log.txt").write_text(f"[WARN] [{BEGUN + 4.5:.6f}, 50.5]: in the midst of the first state\n")
    assert read_task(file).ended_s == pytest.approx(3.0 * max(real_ends_s))
    real, simulated = read_episode(tmp_path), read_episode(tmp_path, in_simulated_time=True)
    start_s = content["states"][0]["started_s"] / 3.0
    assert simulated.task.ended_s - simulated.task.states[0].started_s == pytest.approx(max(real_ends_s) - start_s)
    assert simulated.joints is not None and real.joints is not None
    assert simulated.joints.times_s[-1] < real.joints.times_s[-1]
    assert real.log[0].time_s == pytest.approx(4.5)
    assert simulated.log[0].time_s == pytest.approx(simulated.task.states[0].started_s + 0.5)


def test_a_record_without_simulated_times_is_refused_in_a_pair(tmp_path: Path) -> None:
    write_episode(tmp_path)
    (file,) = (tmp_path / "task_records").glob("*.json")
    content = json.loads(file.read_text())
    for state in content["states"]:
        state["ros_started_s"] = state["ros_ended_s"] = None
    file.write_text(json.dumps(content))
    with pytest.raises(ReplayError, match="the record has no simulated times; allowed: records with simulated time"):
        read_episode(tmp_path, in_simulated_time=True)


def test_the_address_selects_the_table_an_episode_or_a_pair(server: PageServer) -> None:
    for query, name in (
        ("", "episodes.html"),
        ("?failure_class=slipped", "episodes.html"),
        ("?episode=1", "index.html"),
    ):
        assert fetched(server.address + query) == (WEB / name).read_bytes()
    assert fetched(f"{server.address}?pair=0,1") == (WEB / "pair.html").read_bytes()
    table = json.loads(fetched(f"{server.address}run.json"))
    assert [episode["is_replayable"] for episode in table["episodes"]] == [True, True, True, False]
    assert str(WEB.parents[2]) not in json.dumps(table) and all(each["folder"] is None for each in table["episodes"])
    assert [each["number"] for each in json.loads(fetched(f"{server.address}run.json?episode=0"))["partners"]] == [1]
    assert json.loads(fetched(f"{server.address}run.json?episode=2"))["partners"] == []  # its files were pruned
    pair = json.loads(fetched(f"{server.address}run.json?pair=0,1"))
    assert [side["method"] for side in pair["sides"]] == ["rrt", "stomp"] and pair["note"] == ""
    assert "no pair" in json.loads(fetched(f"{server.address}run.json?pair=0,2"))["note"]


def test_an_episode_is_sent_by_its_number_and_a_wrong_number_with_what_is_allowed(server: PageServer) -> None:
    failed = first_message(server, "episode=0&clock=simulated")
    assert (failed["task"]["phase"], failed["task"]["reason"]) == ("failed", "the object fell")
    assert [mark["name"] for mark in failed["record"]["marks"]] == ["lifted"] and failed["drawing"]
    assert first_message(server, "episode=1")["task"]["phase"] == "succeeded"
    assert "allowed: 0 to 3" in first_message(server, "episode=77")["fault"]
    assert "no number of an episode" in first_message(server, "episode=../0")["fault"]
    for query in ("pair=0", "pair=0,x", "pair=0,77", "episode=-1", f"episode={'9' * 5000}"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            fetched(f"{server.address}run.json?{query}")
        assert refused.value.code == 404


def test_a_page_without_an_experiment_has_no_table() -> None:
    with pytest.raises(ReplayError, match="no experiment; open the page with --replay and a result database"):
        PageSource(lambda revision: pytest.fail("not read")).table({})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--episode", "9"], "allowed: 0 to 3"),
        (["--pair", "0", "3"], "episode 3 has no record"),
        (["--experiment", "two_planer"], "has no experiment 'two_planer'; allowed: two_planners"),
    ],
)
def test_the_command_refuses_what_the_database_lacks(
    database: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["--replay", str(database), *arguments], WEB) == 2
    assert message in capsys.readouterr().err


def test_the_command_refuses_options_of_a_database_for_a_single_episode(
    database: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--replay", str(database.parent / "files" / "000000"), "--episode", "0"], WEB) == 2
    assert "is a single episode" in capsys.readouterr().err


IN_SIDE = "document.querySelectorAll('#sides iframe')[{}].contentDocument"


def side_text(browser: Chromium, side: int, selector: str) -> str:
    return str(browser.evaluate(f"{IN_SIDE.format(side)}.querySelector('{selector}')?.textContent ?? ''"))


def move(browser: Chromium, document: str, time_s: float) -> None:
    slider = f"{document}.querySelector('#moment')"
    browser.evaluate(f"{slider}.value = {time_s}; {slider}.dispatchEvent(new Event('input'))")


def test_a_pair_opens_from_the_table_and_shares_one_time_and_cursor(server: PageServer) -> None:
    with Chromium(server.address) as browser:
        browser.shows("#episodes tr.failed", "the object fell")
        browser.evaluate("document.querySelector('#episodes tr.failed td:last-child a').click()")
        browser.shows("#differences", "slipped")
        until(lambda: "the object fell" in side_text(browser, 0, "#sentence"), "the first episode")
        until(lambda: "succeeded" in side_text(browser, 1, "#phase"), "the second episode")
        until(lambda: side_text(browser, 1, "#graph .node.done text") == "Look", "the drawing")
        totals = [f"{IN_SIDE.format(side)}.querySelector('#time').style.getPropertyValue('--total')" for side in (0, 1)]
        until(lambda: browser.evaluate(f"{totals[0]} === {totals[1]}"), "equal time axes")
        move(browser, "document", 1.5)
        for side in (0, 1):
            until(
                lambda side=side: "At 1.5 s: Running: Look." in side_text(browser, side, "#sentence"), "both at 1.5 s"
            )
        move(browser, IN_SIDE.format(1), 0.5)  # the slider of a side moves both
        until(lambda: "At 0.5 s" in side_text(browser, 0, "#sentence"), "the other side follows")
        browser.shows("#shown", "0.50 s")
        browser.evaluate(
            f"""(() => {{ const time = {IN_SIDE.format(0)}.querySelector('#time');
            const bars = time.querySelector('.bars').getBoundingClientRect();
            time.dispatchEvent(new MouseEvent('mousemove', {{ clientX: bars.left + bars.width / 2 }})); }})()"""
        )
        until(
            lambda: browser.evaluate(f"{IN_SIDE.format(1)}.querySelector('#time.with-cursor') !== null"), "one cursor"
        )
        plot = f"{IN_SIDE.format(1)}.querySelector('#plots .u-over')"
        until(lambda: browser.evaluate(f"{plot} !== null"), "the plot of the second episode")
        browser.evaluate(
            f"""(() => {{ const plot = {plot};
            const area = plot.getBoundingClientRect();
            plot.dispatchEvent(new MouseEvent('mousemove', {{ clientX: area.left + area.width / 4 }})); }})()"""
        )
        cursor = f"{IN_SIDE.format(0)}.querySelector('#time').style.getPropertyValue('--cursor')"
        until(lambda: float(browser.evaluate(cursor)) == pytest.approx(3.0, abs=0.2), "the time at the mouse on a plot")
        browser.evaluate("document.querySelector('#play').click()")
        browser.shows("#play", "Pause")
        browser.shows("#play", "Play")  # at the later end of the two tasks
        until(lambda: "succeeded" in side_text(browser, 1, "#phase"), "the end of both tasks")
