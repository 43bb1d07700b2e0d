# SPDX-License-Identifier: BSD-3-Clause
"""A TCP port for commands to an emulator, by which tests and users inject faults.

Text lines over TCP, on the loopback interface if no other is given: `command key=value ...`; one line is the answer to
each, `ok ...` or `error ...`. `help` lists the commands. From a shell: `echo unplug | nc 127.0.0.1 29900`.
"""

from __future__ import annotations

import inspect
import socket
import socketserver
import threading
from collections.abc import Callable, Mapping
from typing import Any

LOOPBACK = "127.0.0.1"
Command = Callable[..., str | None]
Value = bool | int | float | str


class CommandError(Exception):
    """A command cannot be carried out; the text says what is allowed."""


def parse_value(text: str) -> Value:
    """Parses a value: true, false, an integer, a number, or else the text itself."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def run_command(commands: Mapping[str, Command], line: str) -> str:
    """Carries out one line.

    Args:
        commands: what can be done, by name; a docstring's first line is its help.
        line: `name key=value ...`.

    Returns:
        What the command answered, "" for nothing.

    Raises:
        CommandError: unknown command, bad arguments, or the command refused.
    """
    line = line.strip()
    name, *words = line.split()
    if name == "help":
        return "; ".join(
            f"{known}{inspect.signature(function)}: {_first_line(function)}"
            for known, function in sorted(commands.items())
        )
    if name not in commands:
        raise CommandError(f"unknown command '{name}'; known: help, {', '.join(sorted(commands))}")
    pairs = [word.partition("=") for word in words]
    if not all(key and separator for key, separator, _ in pairs):
        raise CommandError(f"'{line}': arguments are written key=value")
    arguments = {key: parse_value(value) for key, _, value in pairs}
    try:
        inspect.signature(commands[name]).bind(**arguments)
    except TypeError as error:
        raise CommandError(f"{name}: {error}; expected {name}{inspect.signature(commands[name])}") from error
    try:
        return commands[name](**arguments) or ""
    except (OSError, ValueError, TypeError) as error:
        raise CommandError(f"{name}: {error}") from error


def _first_line(function: Command) -> str:
    return (inspect.getdoc(function) or "").partition("\n")[0]


class CommandPort:
    """Serves the commands of one emulator; each connection has a thread of its own.

    Args:
        commands: what can be done, by name. Runs on a thread of the port: a command takes its own locks.
        port: TCP port; 0 for any free one.
        address: where to listen.
    """

    def __init__(self, commands: Mapping[str, Command], port: int = 0, address: str = LOOPBACK) -> None:
        self._commands = dict(commands)
        self._wanted = (address, port)
        self._server: socketserver.ThreadingTCPServer | None = None

    @property
    def port(self) -> int:
        """The TCP port; the one asked for until `connect`."""
        return int(self._server.server_address[1]) if self._server is not None else self._wanted[1]

    def connect(self) -> None:
        """Opens the port.

        Raises:
            OSError: the port is taken; the text names it.
        """
        commands = self._commands

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                for line in self.rfile:
                    self.wfile.write((answer(commands, line.decode(errors="replace")) + "\n").encode())

        class Server(socketserver.ThreadingTCPServer):
            allow_reuse_address = True
            daemon_threads = True

        try:
            self._server = Server(self._wanted, Handler)
        except OSError as error:
            address, port = self._wanted
            raise OSError(
                error.errno, f"command port {address}:{port}: {error.strerror}; choose another port"
            ) from error
        threading.Thread(target=self._server.serve_forever, args=(0.05,), name="command_port", daemon=True).start()

    def close(self) -> None:
        """Stops listening. May be called twice."""
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()


def answer(commands: Mapping[str, Command], line: str) -> str:
    """Returns the line that answers a command."""
    if not line.strip():
        return "error: empty line; `help` lists the commands"
    try:
        return f"ok {run_command(commands, line)}".rstrip()
    except CommandError as error:
        return f"error {error}"


def send_command(port: int, command: str, address: str = LOOPBACK, timeout_s: float = 5.0, **arguments: Any) -> str:
    """Sends one command to a running emulator.

    Args:
        port: its command port.
        command: name of the command.
        address: where it runs.
        timeout_s: longest wait for the answer [s].
        arguments: of the command.

    Returns:
        What it answered after `ok`.

    Raises:
        CommandError: it refused.
        OSError: nobody listens, or no answer in time.
    """
    words = [
        command,
        *(f"{key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in arguments.items()),
    ]
    with socket.create_connection((address, port), timeout_s) as connection:
        connection.sendall((" ".join(words) + "\n").encode())
        with connection.makefile() as lines:
            reply = lines.readline().strip()
    status, _, text = reply.partition(" ")
    if status != "ok":
        raise CommandError(text or f"{address}:{port} answered nothing to '{command}'")
    return text
