# SPDX-License-Identifier: BSD-3-Clause
"""Stack of an episode: launched on a separate ROS master, supervised, and stopped completely.

The recorder is a process of its own, because a ROS node belongs to one master for life.
"""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any

from modular_framework_core.files.default_folders import framework_home
from modular_framework_core.launching.launch_session import LaunchSession

LAUNCHER = "modular_framework_benchmark.episodes.ros_stack_launcher"
RECORDER = "modular_framework_benchmark.episodes.ros_episode_recorder"
POLL_S = 0.02
NODE_DIED, END_TIMEOUT_S = "process has died", 30.0
SHARED_FOLDERS = ("convex_parts",)
"""Folders of the framework's home that sessions share, as caches of computed data."""


@dataclass(frozen=True, slots=True)
class StackLaunch:
    """Launch of a stack; episodes with equal launches can share a stack.

    Attributes:
        package: Package of the launch file.
        launch_file: Name of the launch file.
        arguments: Launch arguments.
        parameters: ROS parameters that override parameters of the launch files, keyed by absolute name.
        method_nodes: Absolute names of the grasp generation method's nodes; empty without a method.
        controllers: Names of the controllers to start.
        can_restart: Whether the world can be reset to its state after a cold start.
        regions: Regions of the launch file, to which each episode adds its own.
    """

    package: str
    launch_file: str
    arguments: Mapping[str, str]
    parameters: Mapping[str, Any]
    method_nodes: tuple[str, ...]
    controllers: tuple[str, ...]
    _: KW_ONLY
    can_restart: bool
    regions: Mapping[str, Any] = field(default_factory=dict)


class StackError(RuntimeError):
    """The stack died or does not answer; the message names the process and its last output."""


def write_parameters(path: Path, parameters: Mapping[str, Any]) -> None:
    """Writes a launch file that sets ROS parameters.

    Args:
        path: Path of the launch file.
        parameters: JSON values, keyed by absolute name.
    """
    root = ElementTree.Element("launch")
    for name, value in parameters.items():
        # JSON is valid YAML and preserves types: a number-like text stays a text.
        ElementTree.SubElement(root, "rosparam", {"param": name}).text = json.dumps(value)
    path.write_text(ElementTree.tostring(root, encoding="unicode"))


class Stack:
    """A launched stack with its recorder."""

    def __init__(self, launch: StackLaunch) -> None:
        """Starts the stack and the recorder without waiting.

        Args:
            launch: Launch of the stack.
        """
        self._session = LaunchSession()
        home = Path(self._session.env["ROS_HOME"]) / "modular_framework"
        temporary = self._session.folder / "tmp"
        for folder in (home, temporary):
            folder.mkdir(parents=True)
        for name in SHARED_FOLDERS:
            (framework_home() / name).mkdir(parents=True, exist_ok=True)
            (home / name).symlink_to(framework_home() / name)
        self._session.env["TMPDIR"] = str(temporary)
        self._session.env.pop("DISPLAY", None)
        parameters_file = self._session.folder / "parameters.launch"
        write_parameters(parameters_file, launch.parameters)
        self._launch = self._session.start(
            [
                *(sys.executable, "-m", LAUNCHER, launch.package, launch.launch_file, str(parameters_file)),
                ",".join(launch.method_nodes),
                *(f"{name}:={value}" for name, value in launch.arguments.items()),
            ]
        )
        self._recorder = Recorder(self._session.env, self._session.folder / "recorder.txt", self._launch.process.pid)
        self._log_end = 0

    def write_log(self, path: Path) -> None:
        """Writes the output of the launch since the last call."""
        log = self._launch.log()
        path.write_text(log[self._log_end :])
        self._log_end = len(log)

    def last_output(self) -> str:
        """Returns the last output of the launch as a clause."""
        lines = [line.strip() for line in self._launch.log().splitlines() if line.strip()]
        return f"the launch said last: {lines[-1]}" if lines else "the launch said nothing"

    def request(self, request: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Sends a request to the recorder and returns its answer.

        Args:
            request: JSON values.
            timeout_s: Maximum real time [s].

        Raises:
            StackError: The launch or the recorder died.
            TimeoutError: The answer did not arrive in time.
        """
        self._recorder.send(request)
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            answer = self._recorder.answer(POLL_S)
            if answer is not None:
                return answer
            if not self._launch.alive():
                raise StackError(self._launch_cause())
            if not self._recorder.alive():
                raise StackError(self.root_cause(f"the recorder of the episode died: {self._recorder.last_output()}"))
        raise TimeoutError(f"no end within {timeout_s:g} s")

    def abort(self, timeout_s: float) -> dict[str, Any] | None:
        """Aborts the episode and returns the recorder's answer, or None after the timeout [s]."""
        self._recorder.send({"abort": True})
        return self._recorder.answer(timeout_s)

    def alive(self) -> bool:
        """Returns whether the stack and the recorder are running."""
        return self._launch.alive() and self._recorder.alive()

    def root_cause(self, failure: str) -> str:
        """Returns the root cause of a failure: the death of a node, or else the failure itself.

        Args:
            failure: Description of the failure.
        """
        end = time.monotonic() + END_TIMEOUT_S
        while NODE_DIED in self._launch.log() and self._launch.alive() and time.monotonic() < end:
            time.sleep(POLL_S)  # the launch names the node shortly after
        return failure if self._launch.alive() else self._launch_cause()

    def _launch_cause(self) -> str:
        """Returns the cause of the launch's death from its last output."""
        lines = [line.strip() for line in self._launch.log().splitlines() if line.strip()]
        starts = [number for number, line in enumerate(lines) if line.startswith("run_framework: ")]
        if starts:
            return "the launch died: " + " ".join(lines[starts[-1] :]).removeprefix("run_framework: ")
        return f"the launch died: exit code {self._launch.process.poll()}, {lines[-1] if lines else 'no output'}"

    def stop(self) -> None:
        """Kills all processes and removes all files; repeated calls are allowed."""
        self._session.kill()
        self._recorder.close()


class Recorder:
    """Process of the recorder, which receives requests and sends answers, one line of JSON each."""

    def __init__(self, env: Mapping[str, str], log_path: Path, launch: int) -> None:
        """Starts the process.

        Args:
            env: Environment of the session.
            log_path: File for the standard error output.
            launch: Process id of the stack's launch.
        """
        self._log_path = log_path
        with log_path.open("w") as log_file:
            self._process = subprocess.Popen(
                [sys.executable, "-m", RECORDER, str(launch)],
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
        """Sends a request; a request to a dead recorder is lost."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()

    def answer(self, timeout_s: float) -> dict[str, Any] | None:
        """Returns the next answer, or None after the timeout [s]."""
        try:
            return self._answers.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def alive(self) -> bool:
        """Returns whether the process is running."""
        return self._process.poll() is None

    def last_output(self) -> str:
        """Returns the last line of the log."""
        lines = self._log_path.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self._process.poll()}"

    def close(self) -> None:
        """Ends the process; repeated calls are allowed."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError, ValueError):
                if pipe is not None:
                    pipe.close()
