# SPDX-License-Identifier: BSD-3-Clause
"""A clip shows the recorded world of a task without a browser; what cannot be written is refused with the reason."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import PIL.Image
import pytest
from recorded_files import ORIGIN_S, write_run, write_task

from modular_framework_testing.experiments.recorded_scene_files import write_scene
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.replay_command import main

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"
FOLDER = "files/000001"
"""Folder of episode 1 of the experiment."""


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An experiment whose episode 1 has a recorded world."""
    database = write_run(tmp_path_factory.mktemp("run"))
    write_scene(database.parent / FOLDER, ORIGIN_S)
    return database


def clip(database: Path, *options: str) -> int:
    return main(["--replay", str(database), *options], WEB)


def test_a_video_shows_the_task_in_simulated_time(database: Path, tmp_path: Path) -> None:
    assert clip(database, "--episode", "1", "--clip", str(tmp_path / "pick.mp4")) == 0
    with av.open(str(tmp_path / "pick.mp4")) as video:
        images = [frame.to_ndarray(format="gray").astype(int) for frame in video.decode(video=0)]
    episode = read_episode(database.parent / FOLDER)
    duration_s = episode.to_recording_time(episode.task.ended_s) - episode.to_recording_time(0.0)
    assert len(images) == pytest.approx(10 * duration_s, abs=1)
    assert np.abs(images[-1] - images[0]).max() > 20  # the cube and the carriage have left the picture


def test_a_picture_shows_a_moment_or_the_end_of_the_task(database: Path, tmp_path: Path) -> None:
    names = {"start.png": ["--moment", "0"], "again.png": ["--moment", "0"], "end.png": []}
    for name, options in names.items():
        assert clip(database, "--episode", "1", "--clip", str(tmp_path / name), *options) == 0
    start, again, end = (np.asarray(PIL.Image.open(tmp_path / name)) for name in names)
    assert start.ndim == 3 and (start == again).all() and (start != end).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--clip", "pick.mp4"], "a clip shows an episode of the database; add --episode N"),
        (["--episode", "1", "--clip", "pick.gif"], "pick.gif: got suffix '.gif'; allowed: .mp4 and .png"),
        (["--episode", "1", "--clip", "pick.mp4", "--moment", "1"], "allowed with --moment: .png"),
        (["--episode", "1", "--moment", "1"], "add --clip FILE.png"),
        (["--episode", "0", "--clip", "pick.mp4"], "the record has no world; allowed: an episode of mode task"),
        (["--episode", "3", "--clip", "pick.mp4"], "episode 3 has no record of its task"),
        (["--episode", "1", "--clip", "absent/pick.png"], "absent/pick.png"),
        (["--episode", "1", "--clip", "absent/pick.mp4"], "absent/pick.mp4"),
    ],
)
def test_a_clip_that_cannot_be_written_is_refused(
    database: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert clip(database, *options) == 2
    assert message in capsys.readouterr().err


def test_a_missing_encoder_is_named_with_the_remedy(
    database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(av, "codecs_available", {"mpeg4"})
    assert clip(database, "--episode", "1", "--clip", str(tmp_path / "pick.mp4")) == 2
    assert "lacks the encoder libx264; install PyAV from requirements.txt" in capsys.readouterr().err
    assert not (tmp_path / "pick.mp4").exists()


def test_the_folder_of_an_episode_has_a_clip_and_a_record_of_a_task_alone_has_none(
    database: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--replay", str(database.parent / FOLDER), "--clip", str(tmp_path / "pick.png")], WEB) == 0
    assert main(["--replay", str(write_task(tmp_path)), "--clip", str(tmp_path / "pick.png")], WEB) == 2
    assert "the record has no world" in capsys.readouterr().err
