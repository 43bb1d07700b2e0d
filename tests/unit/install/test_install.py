# SPDX-License-Identifier: BSD-3-Clause
"""The checks of the set-up script before it changes anything."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import shutil
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
    assert "unknown command 'instal'" in answer.stderr and "run, experiment, test, doctor, shell" in answer.stderr


@pytest.mark.parametrize("folder", ["my checkout", "a:b", "price$", "it's"])
def test_refuses_a_path_that_cannot_be_built_in_before_anything_is_done(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir()
    shutil.copy(ROOT / "install.sh", tmp_path / folder)
    answer = subprocess.run([str(tmp_path / folder / "install.sh")], capture_output=True, text=True, check=False)
    assert answer.returncode == 1 and answer.stdout == ""
    assert f"the checkout is in '{tmp_path / folder}'" in answer.stderr and "move it to a path of" in answer.stderr
    assert [item.name for item in (tmp_path / folder).iterdir()] == ["install.sh"]


@pytest.mark.parametrize(
    ("packages", "missing"), [("bash\nno-such-package\n", "no-such-package"), ("bash\n", "the Python environment")]
)
def test_the_doctor_names_what_an_unfinished_installation_lacks_and_installs_nothing(
    tmp_path: Path, packages: str, missing: str
) -> None:
    shutil.copy(ROOT / "install.sh", tmp_path)
    (tmp_path / "packages-debian.txt").write_text(packages)
    answer = subprocess.run([str(tmp_path / "install.sh"), "doctor"], capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert missing in answer.stderr and "missing" in answer.stderr and "what to do: ./install.sh" in answer.stderr
    assert sorted(item.name for item in tmp_path.iterdir()) == ["install.sh", "packages-debian.txt"]


def run_step(folder: Path, command: str, output: int) -> subprocess.Popen[bytes]:
    script = f"source {ROOT}/install.sh; LOG={folder}/log; step 'A long step' 'try again' {command}"
    return subprocess.Popen(["bash", "-c", script], stdout=output, env={**os.environ, "PROGRESS_PERIOD_S": "1"})


def test_a_long_step_counts_its_seconds(tmp_path: Path) -> None:
    output = tmp_path / "output"
    with output.open("w") as stream:
        step = run_step(tmp_path, f"bash -c 'until grep -q \" s ... \" {output}; do sleep 0.1; done'", stream.fileno())
        assert step.wait(60.0) == 0, "the step ends when its seconds are shown"
    assert re.fullmatch(r"A long step \.\.\. (\d+ s \.\.\. )+done \(\d+ s\)\n", output.read_text())


def test_a_long_step_shows_the_last_line_of_its_log_on_a_terminal(tmp_path: Path) -> None:
    terminal, end = pty.openpty()
    gate = tmp_path / "gate"
    step = run_step(tmp_path, f"bash -c 'echo compiling part 7; until [ -e {gate} ]; do sleep 0.1; done'", end)
    os.close(end)
    seen = ""
    with contextlib.suppress(OSError):  # the terminal closes with the step
        while part := os.read(terminal, 4096):
            seen += part.decode()
            if "compiling part 7" in seen:
                gate.touch()
    os.close(terminal)
    assert step.wait(60.0) == 0
    assert re.search(r"A long step \.\.\. \d+ s  compiling part 7", seen) and re.search(r"done \(\d+ s\)\s+$", seen)


def test_every_pinned_requirement_is_asked_for_or_needed_by_one() -> None:
    wanted = {line.split("==")[0].split("[")[0].lower() for line in requirement_lines("requirements.in")}
    pinned = {line.split("==")[0].lower().replace("-", ".") for line in requirement_lines("requirements.txt")}
    assert {name.replace("-", ".") for name in wanted} <= pinned
    assert all("==" in line for line in requirement_lines("requirements.txt"))


def requirement_lines(name: str) -> list[str]:
    lines = (line.split("#")[0].strip() for line in (ROOT / name).read_text().splitlines())
    return [line for line in lines if line]
