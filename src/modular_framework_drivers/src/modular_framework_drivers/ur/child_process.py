# SPDX-License-Identifier: BSD-3-Clause
"""A process with a datagram socket to it; nothing here blocks but `end`.

A pipe of multiprocessing would not do: its `send` blocks while the pipe is full, which the control loop must not do.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence

from modular_framework_drivers.ur.arm_messages import MESSAGE_SIZE

_ORDINARY = ("chrt", "--other", "0")
"""Prefix of the command that gives the process ordinary scheduling, because the parent may run in real time and an
interpreter takes long to start. It is set after the exec: the parent waits until the exec, so a child with ordinary
scheduling before it would delay the parent while other programs use the processors."""


class ChildProcess:
    """A Python module run as a process of its own, with ordinary scheduling, whatever the scheduling of its parent.

    Args:
        module: what to run; gets the first argument, the file descriptor of its socket, then the others.
        arguments: its command line.

    Raises:
        OSError: the system has no room for one.
    """

    def __init__(self, module: str, arguments: Sequence[str]) -> None:
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        with other:
            role, *rest = arguments
            try:
                self._process = subprocess.Popen(
                    [*_ORDINARY, sys.executable, "-m", module, role, str(other.fileno()), *rest],
                    pass_fds=[other.fileno()],
                    stdin=subprocess.DEVNULL,
                )
            except OSError:
                self._socket.close()
                raise
        self.ended = False

    def messages(self) -> Iterator[bytes]:
        """Yields the messages since the last call; sets `ended` when no more can come."""
        while not self.ended:
            try:
                message = self._socket.recv(MESSAGE_SIZE)
            except BlockingIOError:
                return
            except ConnectionResetError:  # it ended without reading all messages to it; those from it come next
                continue
            except OSError:
                message = b""
            if not message:
                self.ended = True
                return
            yield message

    def send(self, message: bytes) -> bool:
        """Sends a message; returns False if the process cannot take it now."""
        try:
            return self._socket.send(message) == len(message)
        except OSError:
            return False

    def end(self, patience_s: float = 0.0) -> None:
        """Ends the process, at once or after it had `patience_s` [s] to end by itself; may be called twice."""
        self.ended = True
        self._socket.close()
        try:
            self._process.wait(patience_s if patience_s > 0.0 else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
