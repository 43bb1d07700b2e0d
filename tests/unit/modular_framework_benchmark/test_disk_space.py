# SPDX-License-Identifier: BSD-3-Clause
"""The dry run estimates the disk that records take; a limit holds, and space is freed without losing results."""

from __future__ import annotations

import io
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from experiment_texts import PICK, read
from fake_runners import record_of
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.commands.prune_command import main as prune
from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.modes.ros_disk_estimate import disk_text, size_text
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import RecordedFiles
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.scheduling.disk_guard import DiskGuard, tree_size
from modular_framework_benchmark.scheduling.experiment_run import ExperimentRun
from modular_framework_benchmark.scheduling.progress import Progress

EPISODE_BYTES = 1000


class WritingPool:
    """Two slots; each episode writes EPISODE_BYTES when it begins, and ends at the next wait."""

    def __init__(self) -> None:
        self.running: list[EpisodeSpec] = []
        self.most_bytes = 0

    def free_slots(self) -> list[str]:
        return ["a", "b"][len(self.running) :]

    def submit(self, _slot: str, spec: EpisodeSpec, folder: Path) -> None:
        folder.mkdir(parents=True)
        (folder / "episode.bag").write_bytes(bytes(EPISODE_BYTES))
        self.running.append(spec)
        self.most_bytes = max(self.most_bytes, tree_size(folder.parent))

    def wait(self, _timeout_s: float) -> list[EpisodeRecord]:
        ended, self.running = self.running, []
        return [record_of(spec) for spec in ended]

    def close(self) -> None: ...

    def kill(self) -> None: ...


def opened(folder: Path) -> tuple[ResultDatabase, int, int]:
    experiment = read(PICK, folder)
    episodes = plan_episodes(experiment)
    database = open_database(folder / "results.db", create=True)
    return database, database.add_experiment(experiment.describe("d", {}), episodes), len(episodes)


@pytest.mark.parametrize("limit", [4500, 10_000])
def test_a_run_ends_before_its_files_exceed_the_limit_and_goes_on_with_a_higher_one(tmp_path: Path, limit: int) -> None:
    database, number, planned = opened(tmp_path)
    pool, folder = WritingPool(), tmp_path / "episodes"

    def run(limit_bytes: float) -> str:
        guard = DiskGuard(folder, limit_bytes)
        progress = Progress(planned, 0, io.StringIO())
        return ExperimentRun(database, number, folder, disk=guard).run(lambda: pool, progress).disk_full

    with database:
        assert f"{limit / 1e9:g}" in run(limit)
        stored = planned - len(database.pending(number))
        assert stored == limit // EPISODE_BYTES and pool.most_bytes <= limit
        assert run(limit) and planned - len(database.pending(number)) == stored, "what is there counts"
        assert run(1e9) == "" and database.pending(number) == []


def test_a_run_ends_before_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    database, number, planned = opened(tmp_path)
    folder = tmp_path / "episodes"
    size = 510e6

    def usage(_path: Path) -> SimpleNamespace:
        return SimpleNamespace(free=size - 3e6 * tree_size(folder) / EPISODE_BYTES)  # each episode takes 3 MB

    monkeypatch.setattr(shutil, "disk_usage", usage)
    with database:
        end = ExperimentRun(database, number, folder).run(WritingPool, Progress(planned, 0, io.StringIO()))
        assert "is almost full: 0.49" in end.disk_full and end.episodes == 4
        assert planned - len(database.pending(number)) == 4


def test_the_estimate_of_bags_counts_the_images_of_the_launch_file(tmp_path: Path) -> None:
    launch = tmp_path / "stack.launch"
    launch.write_text(
        """<launch><rosparam ns="gazebo/sensors">
wrist: {frame_id: lens, data_topics: {rgb_topic: a, depth_map_topic: b, pointcloud_topic: c}, origin_frame_id: world,
  frame_x: 0, frame_y: 0, frame_z: 0, frame_roll: 0, frame_pitch: 0, frame_yaw: 0,
  camera: {width: 320, height: 240, rate: 5}}
</rosparam></launch>"""
    )
    settings = TaskSettings(launch=str(launch), record=RecordedFiles(bag=True))
    text = disk_text([EpisodeSpec(number, {}, number, 1, settings) for number in range(3)])
    image_bytes = 320 * 240 * (3 + 4 + 16)
    assert f"camera 'wrist' in bags at most (320 x 240 at 5 Hz) {size_text(3 * 50 * image_bytes)}" in text
    assert text.startswith("  disk: about 279 MB for 3 episodes, each 10 s of simulated time")
    without = disk_text([EpisodeSpec(0, {}, 0, 1, replace(settings, record=RecordedFiles()))])
    assert "wrist" not in without and "disk: about 710 kB for 1 episodes" in without


@pytest.mark.parametrize(
    ("size", "text"), [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (2.5e8, "250 MB"), (3e13, "30 TB")]
)
def test_sizes_have_units(size: float, text: str) -> None:
    assert size_text(size) == text


def filled(tmp_path: Path) -> tuple[str, list[Path]]:
    """A database with an episode that succeeded and one that failed, and their folders."""
    episodes, folders = sample_episodes(1)[:2], []
    with open_database(tmp_path / "results.db", create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes(1))
        for spec, status in zip(episodes, (EpisodeStatus.SUCCEEDED, EpisodeStatus.FAILED), strict=True):
            folder = tmp_path / "files" / str(spec.number)
            folder.mkdir(parents=True)
            for name in ("episode.bag", "log.txt"):
                (folder / name).write_bytes(bytes(EPISODE_BYTES))
            database.write(number, sample_record(spec, status, folder=f"files/{spec.number}"))
            folders.append(folder)
    return str(tmp_path / "results.db"), folders


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_prune_deletes_files_only_with_its_option_and_keeps_the_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, (succeeded, failed) = filled(tmp_path)
    assert prune([path]) == 0
    assert "picks: 2e-06 GB in 2 files and folders of 2 episodes would be deleted; add" in capsys.readouterr().out
    assert names(succeeded) == names(failed) == {"episode.bag", "log.txt"}
    assert prune([path, "--keep-failures", "--delete"]) == 0
    assert (names(succeeded), names(failed)) == ({"log.txt"}, {"episode.bag", "log.txt"})
    assert prune([path, "--files", "all", "--delete"]) == 0
    assert not succeeded.exists() and not failed.exists()
    assert prune([path, "--files", "all", "--delete"]) == 0, "nothing is left to delete"
    with open_database(path) as database:
        assert [bool(value) for value in database.load(1).episodes["success"]] == [True, False]


def test_prune_leaves_young_episodes_and_folders_outside_alone(tmp_path: Path) -> None:
    path, folders = filled(tmp_path / "here") if (tmp_path / "here").mkdir() is None else ("", [])
    outside = tmp_path / "outside"
    outside.mkdir()
    shutil.rmtree(folders[0])
    folders[0].symlink_to(outside)
    (outside / "episode.bag").write_text("mine")
    assert prune([path, "--older-than", "1e6", "--delete"]) == 0
    assert "episode.bag" in names(folders[1])
    assert prune([path, "--files", "all", "--delete"]) == 0
    assert names(outside) == {"episode.bag"} and not folders[1].exists()
