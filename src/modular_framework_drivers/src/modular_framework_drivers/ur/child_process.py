# SPDX-License-Identifier: BSD-3-Clause
"""Runs a child process connected by a datagram socket; only `end` blocks.

A pipe of multiprocessing is not suitable: its `send` blocks while the pipe is full, which would block the control loop.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence

from modular_framework_drivers.ur.arm_messages import MESSAGE_SIZE

_ORDINARY_SCHEDULING = ("chrt", "--other", "0")
"""Command prefix that starts the child with ordinary scheduling, because the parent may run in real time and an
interpreter starts slowly. The child changes its scheduling after its exec: the parent waits for the exec, and a child
with ordinary scheduling before the exec would delay the parent on busy processors."""


class ChildProcess:
    """Runs a Python module as a child process with ordinary scheduling.

    Args:
        module: Name of the module.
        arguments: Command line; the file descriptor of the child's socket is inserted after the first argument.

    Raises:
        OSError: If the system cannot start another process.
    """

    def __init__(self, module: str, arguments: Sequence[str]) -> None:
        self._socket, child_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        with child_socket:
            role, *rest = arguments
            try:
                self._process = subprocess.Popen(
                    [*_ORDINARY_SCHEDULING, sys.executable, "-m", module, role, str(child_socket.fileno()), *rest],
                    pass_fds=[child_socket.fileno()],
                    stdin=subprocess.DEVNULL,
                )
            except OSError:
                self._socket.close()
                raise
        self.ended = False

    def messages(self) -> Iterator[bytes]:
        """Yields the messages since the last call; sets `ended` once the child has closed the socket."""
        while not self.ended:
            try:
                message = self._socket.recv(MESSAGE_SIZE)
            except BlockingIOError:
                return
            except ConnectionResetError:  # the child ended with unread messages; its own messages come next
                continue
            except OSError:
                message = b""
            if not message:
                self.ended = True
                return
            yield message

    def send(self, message: bytes) -> bool:
        """Sends a message; returns False if the queue of the process is full or the process has ended."""
        try:
            return self._socket.send(message) == len(message)
        except OSError:
            return False

    def end(self, patience_s: float = 0.0) -> bool:
        """Ends the process: waits up to `patience_s` [s], then kills the process; may be called twice.

        Returns:
            Whether the process ended without being killed.
        """
        self.ended = True
        self._socket.close()
        try:
            self._process.wait(patience_s if patience_s > 0.0 else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False
        return True
