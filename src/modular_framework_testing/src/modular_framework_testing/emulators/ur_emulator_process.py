# SPDX-License-Identifier: BSD-3-Clause
"""Runs an emulated UR controller in a separate process with its own loopback address, for tests and benchmarks."""

from __future__ import annotations

import atexit
import os
import random
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from modular_framework_testing.emulators.command_port import send_command
from modular_framework_testing.emulators.ur_controller import HOME
from modular_framework_testing.emulators.ur_emulator import COMMAND_PORT

_MODULE = "modular_framework_testing.emulators.ur_emulator"


def random_local_address() -> str:
    """Returns a random address of this machine, 127.x.y.z, for an emulator beside others."""
    draw = random.Random(os.urandom(8))  # independent of the seeds of a test
    return f"127.{draw.randint(16, 254)}.{draw.randint(0, 254)}.{draw.randint(1, 254)}"


class EmulatedArm:
    """Starts an emulator process.

    Args:
        model: Model of the controller, see ur_controller.py.
        unlock_delay_s: Minimum time from a protective stop to its release [s].
        positions: Initial joint positions [rad].

    Attributes:
        address: Address of the emulator.
    """

    def __init__(self, model: str = "UR5", unlock_delay_s: float = 0.0, positions: Sequence[float] = HOME) -> None:
        self.address = random_local_address()
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                _MODULE,
                "--quiet",
                "--address",
                self.address,
                "--model",
                model,
                "--unlock-delay",
                str(unlock_delay_s),
                "--positions",
                *map(str, positions),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        atexit.register(self.close)
        if self._process.stdout is None or self._process.stdout.readline() != "ready\n":
            raise RuntimeError(f"the emulator at {self.address} did not start; its output is above")

    def command(self, command: str, **arguments: Any) -> str:
        """Sends a command with named arguments to the command port, and returns the response."""
        return send_command(COMMAND_PORT, command, self.address, **arguments)

    def state(self) -> dict[str, str]:
        """Returns the response to the command `state` as a dictionary."""
        return dict(pair.split("=") for pair in self.command("state").split())

    def positions(self) -> list[float]:
        """Returns the joint positions [rad]."""
        return [float(value) for value in self.state()["q"].split(",")]

    def kill(self) -> None:
        """Kills the process."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Ends the process; may be called twice."""
        self._process.terminate()
        self._process.wait(10.0)
        if self._process.stdout is not None:
            self._process.stdout.close()
