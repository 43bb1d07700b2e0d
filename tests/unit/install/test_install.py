# SPDX-License-Identifier: BSD-3-Clause
"""What the set-up script does before it changes anything."""
from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def run_install(*arguments: str, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(ROOT / "install.sh"), *arguments], env={**os.environ, **env}, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("release", ['ID=ubuntu\nVERSION_ID="22.04"\n', 'ID=debian\nVERSION_ID="13"\n', ""])
def test_refuses_an_unsupported_system_and_points_to_docker(tmp_path: Path, release: str) -> None:
    path = tmp_path / "os-release"
    path.write_text(release)
    answer = run_install("run", OS_RELEASE_FILE=str(path))
    assert answer.returncode == 1
    assert "Debian 12 only" in answer.stderr and "docker/deploy.sh" in answer.stderr


def test_refuses_an_unknown_command_and_lists_the_known_ones() -> None:
    answer = run_install("instal")
    assert answer.returncode == 1
    assert "unknown command 'instal'" in answer.stderr and "run, test, shell" in answer.stderr


def test_every_pinned_requirement_is_asked_for_or_needed_by_one() -> None:
    wanted = {line.split("==")[0].lower() for line in requirement_lines("requirements.in")}
    pinned = {line.split("==")[0].lower().replace("-", ".") for line in requirement_lines("requirements.txt")}
    assert {name.replace("-", ".") for name in wanted} <= pinned
    assert all("==" in line for line in requirement_lines("requirements.txt"))


def requirement_lines(name: str) -> list[str]:
    lines = (line.split("#")[0].strip() for line in (ROOT / name).read_text().splitlines())
    return [line for line in lines if line]
