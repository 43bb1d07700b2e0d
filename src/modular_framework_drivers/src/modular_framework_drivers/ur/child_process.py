# SPDX-License-Identifier: BSD-3-Clause
"""A process with a socket of datagrams to it; nothing here blocks but `end`."""
from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence

from modular_framework_drivers.ur.arm_messages import MESSAGE_SIZE

_ORDINARY = ("chrt", "--other", "0")
"""Makes itself ordinary and becomes the command that follows: the starter may run in real time, and to start an
interpreter takes long. A child that is ordinary before its exec would hold its starter up, and all other threads
of that with it, for as long as others use the processors."""


class ChildProcess:
    """A Python module run as a process of its own, with ordinary scheduling whatever its starter has.

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
                    pass_fds=[other.fileno()], stdin=subprocess.DEVNULL)
            except OSError:
                self._socket.close()
                raise
        self.ended = False

    def messages(self) -> Iterator[bytes]:
        """What has come since the last call; sets `ended` when nothing more can come."""
        while not self.ended:
            try:
                message = self._socket.recv(MESSAGE_SIZE)
            except BlockingIOError:
                return
            except ConnectionResetError:    # it went without reading all we said; what it said comes next
                continue
            except OSError:
                message = b""
            if not message:
                self.ended = True
                return
            yield message

    def send(self, message: bytes) -> bool:
        """Send if the process can take it; False when it does not."""
        try:
            return self._socket.send(message) == len(message)
        except OSError:
            return False

    def end(self, patience_s: float = 0.0) -> None:
        """End the process, at once or after it had `patience_s` [s] to do so by itself; may be called twice."""
        self.ended = True
        self._socket.close()
        try:
            self._process.wait(patience_s if patience_s > 0.0 else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
