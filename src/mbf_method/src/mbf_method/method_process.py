# SPDX-License-Identifier: BSD-3-Clause
"""Starts the process of a method in its own Python environment, and ends the process with all its children."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
from contextlib import suppress
from typing import Sequence

from mbf_method.errors import MethodStartError
from mbf_method.served_method import PORT_VARIABLE

PRIVATE_VARIABLES = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
"""Environment variables with which the framework's packages would shadow the method's packages."""
END_TIMEOUT_S = 2.0


class MethodProcess:
    """Process of a method.

    Args:
        command: Program and arguments; no shell interprets them.

    Raises:
        MethodStartError: The system cannot start the program.
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._command = shlex.join(command)
        port = _free_port()
        environment = {name: value for name, value in os.environ.items() if name not in PRIVATE_VARIABLES}
        environment[PORT_VARIABLE] = str(port)
        self.address = f"ws://127.0.0.1:{port}"
        try:
            self._process = subprocess.Popen(
                list(command), stdin=subprocess.DEVNULL, env=environment, start_new_session=True
            )
        except OSError as error:
            raise MethodStartError(f"'{self._command}' cannot be started: {error}; correct the command") from error

    def end_text(self, timeout_s: float = 0.0) -> str:
        """Returns the exit status as text; "" while the process runs.

        Args:
            timeout_s: Maximum wait for the end of the process [s].
        """
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return ""
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"exited with code {code}"
        return f"'{self._command}' {how}"

    def close(self) -> None:
        """Ends the process and its children."""
        self._send_signal(signal.SIGTERM)
        self.end_text(END_TIMEOUT_S)
        self._send_signal(signal.SIGKILL)
        self._process.wait()

    def _send_signal(self, number: signal.Signals) -> None:
        """Sends a signal to the process and its children; no effect after their end."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)


def _free_port() -> int:
    """Returns a TCP port of the loopback interface on which no process listens."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])
