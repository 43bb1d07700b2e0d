# SPDX-License-Identifier: BSD-3-Clause
"""The one-line deployer makes the right calls, recorded by a fake docker command."""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

DEPLOY = Path(__file__).parents[3] / "docker" / "deploy.sh"

# Records each call on a line of $RECORD; fails for the calls listed in $FAILING (by their first words).
FAKE_DOCKER = """#!/bin/bash
printf '%s\\n' "$*" >> "$RECORD"
while IFS= read -r prefix; do
  [ -n "$prefix" ] && [[ "$*" == "$prefix"* ]] && exit 1
done <<< "$FAILING"
exit 0
"""


@dataclass
class Recorder:
    """Runs the deployer with the fake docker first in PATH."""

    folder: Path
    failing: list[str] = field(default_factory=list)
    env: dict[str, str] = field(default_factory=dict)

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        env = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "XAUTHORITY")}
        env.update(
            PATH=f"{self.folder}:{env['PATH']}", RECORD=str(self.record), FAILING="\n".join(self.failing), **self.env
        )
        return subprocess.run([str(DEPLOY), *arguments], env=env, capture_output=True, text=True, check=False)

    @property
    def record(self) -> Path:
        return self.folder / "calls.txt"

    def calls(self, verb: str) -> list[str]:
        lines = self.record.read_text().splitlines() if self.record.exists() else []
        return [line for line in lines if line.startswith(verb)]


@pytest.fixture
def docker(tmp_path: Path) -> Recorder:
    fake_docker = tmp_path / "docker"
    fake_docker.write_text(FAKE_DOCKER)
    fake_docker.chmod(0o755)
    return Recorder(tmp_path, failing=["container inspect", "image inspect"])


def test_builds_the_image_and_runs_the_framework_when_nothing_is_there(docker: Recorder) -> None:
    assert docker.run("container_name=mbf", "nvidia=false").returncode == 0
    (build,) = docker.calls("build")
    assert "-t modular_framework" in build and "docker/Dockerfile" in build
    (run,) = docker.calls("run")
    assert "--name mbf" in run and run.endswith("modular_framework run")
    assert "--gpus" not in run and "DISPLAY" not in run


def test_does_not_build_an_image_that_is_there(docker: Recorder) -> None:
    docker.failing = ["container inspect"]
    assert docker.run("container_name=mbf", "nvidia=false").returncode == 0
    assert not docker.calls("build") and docker.calls("run")


def test_starts_an_existing_container_again(docker: Recorder) -> None:
    docker.failing = []
    assert docker.run("container_name=mbf", "nvidia=false").returncode == 0
    assert docker.calls("start") == ["start --attach mbf"] and not docker.calls("run")


def test_hands_over_the_gpu_only_when_asked(docker: Recorder) -> None:
    assert docker.run("container_name=mbf", "nvidia=true").returncode == 0
    assert "--gpus all" in docker.calls("run")[0]


def test_hands_over_the_screen_and_its_key(docker: Recorder, tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.touch()
    docker.env = {"DISPLAY": ":7", "XAUTHORITY": str(key)}
    docker.run("container_name=mbf", "nvidia=false")
    (run,) = docker.calls("run")
    assert "DISPLAY=:7" in run and "/tmp/.X11-unix" in run and f"{key}:/home/user/.Xauthority:ro" in run


def test_hands_launch_arguments_on(docker: Recorder) -> None:
    docker.run("container_name=mbf", "nvidia=false", "rviz:=false", "world_file:=ur5_table.world")
    assert docker.calls("run")[0].endswith("run rviz:=false world_file:=ur5_table.world")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((), "container_name"),
        (("container_name=mbf",), "nvidia"),
        (("container_name=mbf", "nvidia=yes"), "allowed: true, false"),
        (("container_name=a b", "nvidia=true"), "container_name is 'a b'"),
        (("container_name=mbf", "nvidia=true", "colour=red"), "unknown argument 'colour=red'"),
    ],
)
def test_refuses_wrong_arguments_before_any_docker_call(
    docker: Recorder, arguments: tuple[str, ...], named: str
) -> None:
    answer = docker.run(*arguments)
    assert answer.returncode == 1 and named in answer.stderr
    assert not docker.record.exists()


def test_says_that_the_engine_does_not_answer(docker: Recorder) -> None:
    docker.failing = ["info"]
    answer = docker.run("container_name=mbf", "nvidia=false")
    assert answer.returncode == 1 and "engine does not answer" in answer.stderr


def test_refuses_launch_arguments_for_an_existing_container(docker: Recorder) -> None:
    docker.failing = []
    answer = docker.run("container_name=mbf", "nvidia=false", "rviz:=false")
    assert answer.returncode == 1 and "exists already" in answer.stderr and not docker.calls("start")
