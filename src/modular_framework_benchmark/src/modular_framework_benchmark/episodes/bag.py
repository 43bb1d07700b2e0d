# SPDX-License-Identifier: BSD-3-Clause
"""Records all topics of a ROS master to a bag during an episode."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from pathlib import Path

from modular_framework_benchmark.episodes.errors import BagError

BAG, BAG_LOG = "episode.bag", "bag.txt"
NODE = "episode_bag"
END_TIMEOUT_S = 30.0


class BagRecording:
    """A rosbag process on the master of the environment."""

    def __init__(self, folder: Path) -> None:
        """Starts the recording.

        Args:
            folder: Folder of `episode.bag` and of `bag.txt`, the output of rosbag.
        """
        self.path, self._log_path = folder / BAG, folder / BAG_LOG
        command = ["rosrun", "rosbag", "record", "--all", "-O", str(self.path), f"__name:={NODE}"]
        with self._log_path.open("w") as log_file:
            self._process = subprocess.Popen(command, stdout=log_file, stderr=log_file, start_new_session=True)

    def check(self) -> None:
        """Raises BagError if the process has ended."""
        if self._process.poll() is not None:
            lines = self._log_path.read_text(errors="replace").strip().splitlines()
            raise BagError(
                f"{self.path} is not recorded: rosbag {lines[-1] if lines else f'exited with {self._process.poll()}'}; "
                "install python3-rosbag, or remove `record: {bag: true}`"
            )

    def close(self) -> None:
        """Ends the recording and waits until the file is complete; repeated calls are allowed."""
        self._signal(signal.SIGINT)
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._signal(signal.SIGKILL)
            self._process.wait()

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)
