# SPDX-License-Identifier: BSD-3-Clause
"""Runners of episodes that take no time, or fail in every way a real one can; they run in real worker processes."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus


def record_of(spec: EpisodeSpec, status: EpisodeStatus = EpisodeStatus.SUCCEEDED, cause: str = "") -> EpisodeRecord:
    """Returns a record whose values follow from the episode alone."""
    known = {"success": 1.0, "task_time": spec.seed % 1000 / 1000}
    metrics = {name: known[name] for name in spec.settings.metric_names}
    return EpisodeRecord(
        spec, status, outcome="", cause=cause, begun=time.time(), wall_s=0.01, simulated_s=1.0, metrics=metrics
    )


class QuickRunner:
    """Writes one file for each episode."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        assert not list(folder.iterdir()), "the folder of an episode is empty"
        (folder / "log.txt").write_text(f"{os.getpid()} ran {spec.key}\n")
        time.sleep(float(os.environ.get("FAKE_EPISODE_S", "0")))
        note_run(spec)
        return record_of(spec)

    def close(self) -> None:
        pass


class NodeRunner(QuickRunner):
    """Starts a process in a session of its own for each episode, as roslaunch does for a node."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        node = subprocess.Popen(["sleep", "600"], start_new_session=True)
        record = super().run(spec, folder)
        node.kill()
        node.wait()
        return record


class DyingRunner(QuickRunner):
    """Its process is killed: in trial 0 always, in trial 1 the first time, by the file FAKE_TRIES names."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        tries = Path(os.environ["FAKE_TRIES"]) / spec.key.replace("/", "_")
        first = not tries.exists()
        tries.touch()
        if spec.trial == 0 or spec.trial == 1 and first:
            print("the worker is about to die", flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        return super().run(spec, folder)


class BrokenRunner(QuickRunner):
    """Has a fault in every episode."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        """Raises an exception."""
        raise ValueError("the simulator is not there")


class RaisingRunner(QuickRunner):
    """Raises in every second trial."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        if spec.trial % 2:
            raise ValueError("this mode has a fault")
        return super().run(spec, folder)


class HangingRunner(QuickRunner):
    """Does not return in trial 0."""

    def run(self, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
        if spec.trial == 0:
            time.sleep(600)
        return super().run(spec, folder)


def no_runner() -> QuickRunner:
    """Cannot make a runner."""
    raise RuntimeError("the robot is not there")


def note_run(spec: EpisodeSpec) -> None:
    """Appends the episode to the file FAKE_RUNS names: each line is an episode that ran to its end."""
    path = os.environ.get("FAKE_RUNS")
    if path:
        with open(path, "a", encoding="utf-8") as stream:
            stream.write(f"{spec.key}\n")
