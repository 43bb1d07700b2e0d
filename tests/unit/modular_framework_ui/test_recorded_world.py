# SPDX-License-Identifier: BSD-3-Clause
"""The page of a record has the recorded world, at the time that the page shows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from recorded_files import ORIGIN_S, write_episode
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from modular_framework_benchmark.episodes.recorded_scene import RecordedScene
from modular_framework_simulation.sensors.scene_text import ScenePoses
from modular_framework_simulation.viewer.web_server import free_port
from modular_framework_testing.chromium import Chromium
from modular_framework_testing.experiments.recorded_scene_files import write_scene
from modular_framework_testing.ros_session import until
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.replay_command import replay_source

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_episode(tmp_path)
    write_scene(tmp_path, ORIGIN_S)
    return tmp_path


@pytest.fixture
def drawn_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times at which the world was drawn [s since the start of the recording]."""
    times_s: list[float] = []
    poses = RecordedScene.poses

    def noted_poses(scene: RecordedScene, time_s: float) -> ScenePoses:
        times_s.append(time_s)
        return poses(scene, time_s)

    monkeypatch.setattr(RecordedScene, "poses", noted_poses)
    return times_s


@pytest.fixture
def server(folder: Path, drawn_s: list[float]) -> Iterator[PageServer]:
    server = PageServer(WEB, replay_source(str(folder)), "127.0.0.1", free_port("127.0.0.1", 8970))
    server.start()
    yield server
    server.close()


def is_drawn(drawn_s: list[float], time_s: float) -> bool:
    return drawn_s[-1] == pytest.approx(time_s)


def test_times_of_the_task_are_those_of_the_recording_by_both_clocks(folder: Path) -> None:
    real, simulated = read_episode(folder), read_episode(folder, in_simulated_time=True)
    close = next(state for state in real.task.states if state.path == "Hold/Close")
    assert close.ros_started_s is not None
    assert real.to_recording_time(close.started_s) == pytest.approx(close.ros_started_s - ORIGIN_S)
    close = next(state for state in simulated.task.states if state.path == "Hold/Close")
    assert simulated.to_recording_time(close.started_s) == pytest.approx(close.ros_started_s - ORIGIN_S)


def test_the_page_says_what_the_recorded_world_lacks(folder: Path) -> None:
    omissions = read_episode(folder).omissions
    assert "the world" not in omissions and "the planning scene" in omissions
    assert "the shape of parcel except for bounding boxes" in omissions


def test_the_world_is_drawn_at_the_time_that_a_page_sends(
    server: PageServer, drawn_s: list[float], folder: Path
) -> None:
    episode = read_episode(folder)
    with connect(f"{server.address.replace('http:', 'ws:')}live", max_size=None) as page:
        assert json.loads(page.recv(timeout=20.0))["viewer"].startswith("http://127.0.0.1:")
        for time_s in (2.5, 1.0):
            page.send(json.dumps({"view_s": time_s}))
            until(lambda time_s=time_s: is_drawn(drawn_s, episode.to_recording_time(time_s)), "the world at this time")
        page.send(json.dumps({"view_s": None}))
        end_s = episode.to_recording_time(episode.task.ended_s)
        until(lambda: is_drawn(drawn_s, end_s), "the world at the end of the task")


@pytest.mark.parametrize("text", ["", "{", "[" * 1000, "7", "{}", '{"view_s": "1"}', '{"view_s": NaN}'])
def test_another_message_ends_the_connection(server: PageServer, text: str) -> None:
    with connect(f"{server.address.replace('http:', 'ws:')}live", max_size=None) as page:
        page.recv(timeout=20.0)
        page.send(text)
        with pytest.raises(ConnectionClosed, match="read-only except for the time of a recorded world"):
            page.recv(timeout=20.0)


def test_the_slider_moves_the_world_in_a_browser(server: PageServer, drawn_s: list[float], folder: Path) -> None:
    episode = read_episode(folder)
    with Chromium(server.address) as browser:
        browser.shows("#log", "the shape of parcel except for bounding boxes")
        until(lambda: browser.evaluate("document.querySelector('#world iframe') !== null"), "the view of the world")
        slider = "document.querySelector('#moment')"
        browser.evaluate(f"{slider}.value = 2; {slider}.dispatchEvent(new Event('input'))")
        until(lambda: is_drawn(drawn_s, episode.to_recording_time(2.0)), "the world at 2 s")
        browser.evaluate("document.querySelector('#latest').click()")
        until(lambda: is_drawn(drawn_s, episode.to_recording_time(episode.task.ended_s)), "the world at the end")
