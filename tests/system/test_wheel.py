# SPDX-License-Identifier: BSD-3-Clause
"""The wheel works in a fresh environment without ROS: the tutorial runs as written, and every module is importable."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/tutorial_without_ros.md"
BLOCK = re.compile(r"^```(bash|python)\n(.+?)^```", re.MULTILINE | re.DOTALL)
sys.path.insert(0, str(ROOT / "tests/unit/modular_framework_benchmark"))
from reported_experiment import ReportedExperiment  # noqa: E402

ENVIRONMENT = {
    name: value for name, value in os.environ.items() if name in ("HOME", "LANG") or name.startswith(("PIP_", "SSL_"))
} | {"PATH": "/usr/bin:/bin", "FRAMEWORK": str(ROOT), "PYTHONNOUSERSITE": "1"}
"""Environment of a shell in which no workspace is sourced."""

IMPORT_ALL = """
import importlib, importlib.metadata, pathlib, sys
modules = [
    ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    for file in importlib.metadata.files("modular-benchmarking-framework")
    if file.suffix == ".py"
]
for module in modules:
    importlib.import_module(module)
assert "rospy" not in sys.modules and "rospkg" not in sys.modules
print(len(modules))
"""


def run(command: str, folder: Path, timeout_s: float = 600.0) -> str:
    """Runs shell commands without ROS and returns their output."""
    answer = subprocess.run(
        ["bash", "-euc", command],
        cwd=folder,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    assert answer.returncode == 0, f"{command}\n{answer.stdout}\n{answer.stderr}"
    return answer.stdout


@pytest.fixture(scope="module")
def index(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Skips the tests if pip finds no packages: neither an index on the network nor one on the disk."""
    folder = tmp_path_factory.mktemp("index")
    command = ["/usr/bin/env", sys.executable, "-m", "pip", "download", "--no-deps", "--dest", folder, "hatchling"]
    answer = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=300, check=False)
    if answer.returncode:
        pytest.skip(f"pip finds no package index, from which the wheel's requirements come: {answer.stderr[-300:]}")


@pytest.fixture(scope="module")
def folder(index: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a reader who has followed the tutorial, with a database of a colleague; returns the folder."""
    folder = tmp_path_factory.mktemp("without_ros")
    ReportedExperiment(trials=8, with_files=False).store(folder / "two_planners.db")
    outputs = []
    for kind, text in BLOCK.findall(PAGE.read_text()):
        (folder / "notebook.py").write_text(text)
        outputs.append(run(text if kind == "bash" else "mbf_env/bin/python notebook.py", folder))
    (folder / "outputs").write_text("\n".join(outputs))
    return folder


def test_the_tutorial_leads_to_what_it_promises(folder: Path) -> None:
    outputs = " ".join((folder / "outputs").read_text().split())
    for promised in (
        "goal biased succeeds more often than uniform (+20 points, 95 % interval 4 to 37, 40 paired episodes)",
        "goal biased success [%] ↑ 70.0 30.0 −40 (−59 to −18)",
        "rrt_connect",
    ):
        assert promised in outputs, outputs
    for file in ("planners.html", "planners.tex", "changes.html", "two_planners.html", "tables"):
        assert (folder / file).exists(), file


def test_every_module_of_the_wheel_is_importable_without_ros(folder: Path) -> None:
    assert int(run(f"mbf_env/bin/python -c '{IMPORT_ALL}'", folder)) > 150


def test_a_build_gives_the_same_wheel_twice(index: None, tmp_path: Path) -> None:
    digests = set()
    for name in ("first", "second"):
        run(f"{ROOT}/install.sh wheel {tmp_path / name}", ROOT)
        (wheel,) = (tmp_path / name).glob("*.whl")
        digests.add(hashlib.sha256(wheel.read_bytes()).hexdigest())
    assert len(digests) == 1
