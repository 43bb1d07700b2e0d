# SPDX-License-Identifier: BSD-3-Clause
"""How far an experiment is: counts, time left, a bar on a terminal and lines elsewhere."""

from __future__ import annotations

import io
from pathlib import Path

import fake_runners
from experiment_texts import PICK, read

from modular_framework_benchmark.experiments.design import plan_episodes
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.scheduling.progress import Progress


class Clock:
    time_s = 100.0

    def __call__(self) -> float:
        return self.time_s


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        raise OSError("it has no size")


def test_the_counts_and_the_time_left_are_those_of_this_run(tmp_path: Path) -> None:
    clock, stream, specs = Clock(), io.StringIO(), plan_episodes(read(PICK, tmp_path))
    progress = Progress(48, 8, stream, clock)
    assert "remaining time unknown" in progress.text()
    for number, status in enumerate([EpisodeStatus.SUCCEEDED, EpisodeStatus.FAILED, EpisodeStatus.TIMED_OUT] * 4):
        clock.time_s += 10.0
        progress.add(fake_runners.record_of(specs[number], status))
    assert progress.text() == (
        "20 of 48 episodes (8 before): 4 succeeded, 4 failed, 4 timed out, 0 broken, 0 invalid; about 0:04:40 remaining"
    )
    lines = stream.getvalue().splitlines()
    assert len(lines) == 6, "a line now and then, not one for each episode"


def test_a_broken_episode_is_told_at_once_with_its_cause(tmp_path: Path) -> None:
    stream, specs = io.StringIO(), plan_episodes(read(PICK, tmp_path))
    Progress(48, 0, stream, Clock()).add(fake_runners.record_of(specs[3], EpisodeStatus.BROKEN, "move_group died"))
    assert stream.getvalue() == f"episode 3 ({specs[3].key}) is broken: move_group died\n"


def test_a_terminal_has_a_bar_that_fits_into_its_width(tmp_path: Path) -> None:
    clock, stream, specs = Clock(), Terminal(), plan_episodes(read(PICK, tmp_path))
    progress = Progress(48, 0, stream, clock)
    for spec in specs[:24]:
        clock.time_s += 1.0
        progress.add(fake_runners.record_of(spec))
    progress.end()
    shown = stream.getvalue().split("\r")[-1]
    assert shown.startswith("[############............] 24 of 48 episodes: 24 succeeded")
    assert shown.endswith("\033[K\n") and len(shown) <= 79 + len("\033[K\n")
