# SPDX-License-Identifier: BSD-3-Clause
"""The stack of an episode: launched on a ROS master of its own, watched, and stopped so that nothing of it is left.

What runs beside the stack and records it is a process of the session, too: a ROS node belongs to one master for life.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from modular_framework_core.files.default_folders import framework_home
from modular_framework_core.launching.launch_session import Launch, LaunchSession

LAUNCHER = "modular_framework_benchmark.episodes.ros_stack_launcher"
RECORDER = "modular_framework_benchmark.episodes.ros_episode_recorder"
POLL_S = 0.02
SHARED_FOLDERS = ("convex_parts",)
"""Folders of the framework's home that sessions share: what is computed once for all."""


class StackError(RuntimeError):
    """The stack died or does not answer; the text says what died, and its last words."""


def write_parameters(path: Path, parameters: Mapping[str, Any]) -> None:
    """Writes a launch file that sets ROS parameters.

    Args:
        path: File to write.
        parameters: JSON values by absolute name.
    """
    root = ElementTree.Element("launch")
    for name, value in parameters.items():
        # JSON is YAML, and says the type: a text that looks like a number stays a text
        ElementTree.SubElement(root, "rosparam", {"param": name}).text = json.dumps(value)
    path.write_text(ElementTree.tostring(root, encoding="unicode"))


class Stack:
    """A launched stack and the recorder beside it."""

    def __init__(
        self,
        package: str,
        launch_file: str,
        arguments: Mapping[str, str],
        parameters: Mapping[str, Any],
        folder: Path,
    ) -> None:
        """Starts both; does not wait for them.

        Args:
            package: Package of the launch file.
            launch_file: Its name.
            arguments: Launch arguments.
            parameters: ROS parameters over those of the launch files, by absolute name.
            folder: Folder for the logs of the launch and of the recorder.
        """
        self._session = LaunchSession()
        home = Path(self._session.env["ROS_HOME"]) / "modular_framework"
        home.mkdir(parents=True)
        for name in SHARED_FOLDERS:
            (framework_home() / name).mkdir(parents=True, exist_ok=True)
            (home / name).symlink_to(framework_home() / name)
        self._session.env.pop("DISPLAY", None)
        parameters_file = self._session.folder / "parameters.launch"
        write_parameters(parameters_file, parameters)
        self._launch = self._session.start(
            [
                *(sys.executable, "-m", LAUNCHER, package, launch_file, str(parameters_file)),
                *(f"{name}:={value}" for name, value in arguments.items()),
            ],
            folder / "log.txt",
        )
        self._recorder = Recorder(self._session.env, folder / "recorder.txt")

    @property
    def launch(self) -> Launch:
        """The launch."""
        return self._launch

    def log(self) -> str:
        """Returns what the launch has printed so far."""
        return self._launch.log()

    def ask(self, request: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Has the recorder do something, and returns its answer.

        Args:
            request: JSON values.
            timeout_s: Longest real time for it [s].

        Raises:
            StackError: The launch or the recorder died.
            TimeoutError: There was no answer in time.
        """
        self._recorder.send(request)
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            answer = self._recorder.answer(POLL_S)
            if answer is not None:
                return answer
            if not self._launch.alive():
                raise StackError(self.cause())
            if not self._recorder.alive():
                raise StackError(f"the recorder of the episode died: {self._recorder.last_words()}")
        raise TimeoutError(f"no end within {timeout_s:g} s")

    def abort(self, timeout_s: float) -> dict[str, Any] | None:
        """Has the recorder write what it has; returns its answer, None without one in time [s]."""
        self._recorder.send({"abort": True})
        return self._recorder.answer(timeout_s)

    def alive(self) -> bool:
        """Returns whether the stack and the recorder run."""
        return self._launch.alive() and self._recorder.alive()

    def cause(self) -> str:
        """Returns why the launch ended: its own last words."""
        lines = [line.strip() for line in self.log().splitlines() if line.strip()]
        own = [number for number, line in enumerate(lines) if line.startswith("run_framework: ")]
        if own:
            return " ".join(lines[own[-1] :]).removeprefix("run_framework: ")
        return f"the launch ended with exit code {self._launch.process.poll()}: {lines[-1] if lines else 'no output'}"

    def stop(self) -> None:
        """Stops everything and leaves no process. May be called twice."""
        self._recorder.close()
        self._session.stop()

    def processes(self) -> list[int]:
        """Returns the processes of the stack that run now."""
        return self._session.processes()


class Recorder:
    """The recorder's process: takes requests and gives answers, a line of JSON each."""

    def __init__(self, env: Mapping[str, str], log_path: Path) -> None:
        """Starts it.

        Args:
            env: Environment of the session.
            log_path: File for what it prints beside its answers.
        """
        self._log_path = log_path
        with log_path.open("w") as log_file:
            self._process = subprocess.Popen(
                [sys.executable, "-m", RECORDER],
                env=dict(env),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log_file,
                text=True,
                start_new_session=True,
            )
        self._answers: queue.Queue[dict[str, Any]] = queue.Queue()
        threading.Thread(target=self._read, daemon=True, name="episode recorder").start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                self._answers.put(json.loads(line))

    def send(self, request: Mapping[str, Any]) -> None:
        """Sends a request; one to a dead recorder is lost."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()

    def answer(self, timeout_s: float) -> dict[str, Any] | None:
        """Returns the next answer; None when there is none in time [s]."""
        try:
            return self._answers.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def alive(self) -> bool:
        """Returns whether it runs."""
        return self._process.poll() is None

    def last_words(self) -> str:
        """Returns the last line it printed."""
        lines = self._log_path.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self._process.poll()}"

    def close(self) -> None:
        """Ends it. May be called twice."""
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if pipe is self._process.stdin and pipe is not None:
                    pipe.close()
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._process.pid, 9) if self._process.poll() is None else None
        self._process.wait()
