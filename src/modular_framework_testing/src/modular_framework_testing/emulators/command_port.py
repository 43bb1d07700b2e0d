# SPDX-License-Identifier: BSD-3-Clause
"""Serves commands to an emulator over TCP, with which tests and users inject faults.

A command is a text line `command key=value ...`, by default on the loopback interface; the response is one line,
`ok ...` or `error ...`. `help` lists the commands. Example in a shell: `echo unplug | nc 127.0.0.1 29900`.
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
    """Raised if a command cannot be executed; the text gives the cause."""


def parse_value(text: str) -> Value:
    """Parses a value: true, false, an integer or a number; any other text is returned unchanged."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def run_command(commands: Mapping[str, Command], line: str) -> str:
    """Executes the command in one line.

    Args:
        commands: Commands by name; the first line of a docstring is the help text.
        line: Command line `name key=value ...`.

    Returns:
        The response of the command; "" for none.

    Raises:
        CommandError: If the command is unknown, has invalid arguments or fails.
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
    """Serves the commands of one emulator, with a thread per connection.

    Args:
        commands: Commands by name; called on threads of the port, so each command must acquire its own locks.
        port: TCP port; 0 for any free port.
        address: Address of the interface.
    """

    def __init__(self, commands: Mapping[str, Command], port: int = 0, address: str = LOOPBACK) -> None:
        self._commands = dict(commands)
        self._requested_address = (address, port)
        self._server: socketserver.ThreadingTCPServer | None = None

    @property
    def port(self) -> int:
        """Returns the TCP port; before `connect`, the requested port."""
        return int(self._server.server_address[1]) if self._server is not None else self._requested_address[1]

    def connect(self) -> None:
        """Opens the port.

        Raises:
            OSError: If the port is in use; the text names the port.
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
            self._server = Server(self._requested_address, Handler)
        except OSError as error:
            address, port = self._requested_address
            raise OSError(
                error.errno, f"command port {address}:{port}: {error.strerror}; choose another port"
            ) from error
        threading.Thread(target=self._server.serve_forever, args=(0.05,), name="command_port", daemon=True).start()

    def close(self) -> None:
        """Closes the port; may be called twice."""
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()


def answer(commands: Mapping[str, Command], line: str) -> str:
    """Returns the response line to a command line."""
    if not line.strip():
        return "error: empty line; `help` lists the commands"
    try:
        return f"ok {run_command(commands, line)}".rstrip()
    except CommandError as error:
        return f"error {error}"


def send_command(port: int, command: str, address: str = LOOPBACK, timeout_s: float = 5.0, **arguments: Any) -> str:
    """Sends one command to a running emulator.

    Args:
        port: Command port of the emulator.
        command: Name of the command.
        address: Address of the emulator.
        timeout_s: Timeout of the response [s].
        arguments: Arguments of the command.

    Returns:
        The response after `ok`.

    Raises:
        CommandError: If the command failed.
        OSError: If the emulator cannot be reached or does not respond in time.
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
