# SPDX-License-Identifier: BSD-3-Clause
"""The deployer with a docker command that records its calls."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

DEPLOY = Path(__file__).parents[3] / "docker" / "deploy.sh"
STAND_IN = Path(__file__).with_name("recording_docker.py")
USER_ID = os.environ.get("SUDO_UID", str(os.getuid()))
CONTAINER_USER = 1000 if USER_ID == "0" else int(USER_ID)


@dataclass
class Deployer:
    """Runs the deployer with the recording docker first in PATH.

    Attributes:
        folder: State of the recording `docker` command; `bin` in it is first in PATH.
        env: Environment variables that a test adds.
        path: The rest of PATH.
    """

    folder: Path
    env: dict[str, str] = field(default_factory=dict)
    path: str = os.environ["PATH"]

    def run(self, *arguments: str, stdin: int = subprocess.DEVNULL) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(DEPLOY), *arguments], env=self.environment(), stdin=stdin, capture_output=True, text=True, check=False
        )

    def environment(self) -> dict[str, str]:
        env = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "XAUTHORITY")}
        own = {"PATH": f"{self.folder}/bin:{self.path}", "STAND_IN": str(self.folder), "HOME": str(self.folder)}
        return {
            **env,
            **own,
            "GRAPHICS_DEVICE": "/no/graphics",
            "NVIDIA_DRIVER": "/dev/null",
            "WSL_DRIVER": "/no/driver",
            "XDG_CACHE_HOME": f"{self.folder}/cache",
            **self.env,
        }

    def deploy(self, *arguments: str) -> str:
        """Runs it with the two arguments that are always needed; it must succeed. Returns what it printed."""
        answer = self.run("container_name=mbf", "nvidia=false", *arguments)
        assert answer.returncode == 0, answer.stderr
        return answer.stdout

    def refusal(self, *arguments: str) -> str:
        """As deploy, but it must fail. Returns its error."""
        answer = self.run("container_name=mbf", "nvidia=false", *arguments)
        assert answer.returncode == 1, answer.stdout
        return answer.stderr

    @property
    def record(self) -> Path:
        return self.folder / "calls.jsonl"

    def commands(self) -> list[list[str]]:
        """Returns all recorded calls, each as its arguments."""
        lines = self.record.read_text().splitlines() if self.record.exists() else []
        return [list(json.loads(line)) for line in lines]

    def calls(self, verb: str) -> list[str]:
        """Returns the recorded calls that begin with a verb, each as one line."""
        lines = [" ".join(command) for command in self.commands()]
        return [line for line in lines if line.startswith(verb)]

    def forget_calls(self) -> None:
        self.record.unlink()

    def set_running(self) -> None:
        container = self.folder / "container.json"
        container.write_text(json.dumps({**json.loads(container.read_text()), "running": True}))


def add_command(folder: Path, name: str, text: str) -> None:
    """Makes a command of the given bash text."""
    path = folder / name
    path.write_text(f"#!/bin/bash\n{text}\n")
    path.chmod(0o755)
