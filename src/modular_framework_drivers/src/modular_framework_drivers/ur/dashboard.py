# SPDX-License-Identifier: BSD-3-Clause
"""Client of the dashboard server of an arm; one line per request."""

from __future__ import annotations

import socket

DASHBOARD_PORT = 29999


class DashboardError(Exception):
    """The dashboard server did not answer."""


def ask_dashboard(address: str, line: str, timeout_s: float = 2.0, port: int = DASHBOARD_PORT) -> str:
    """Sends one line and returns the answer.

    Args:
        address: of the arm's controller.
        line: for example "unlock protective stop".
        timeout_s: for the connection and for each answer [s].
        port: of the dashboard server.

    Raises:
        DashboardError: nobody listens, or no answer in time.
    """
    try:
        with (
            socket.create_connection((address, port), timeout_s) as connection,
            connection.makefile("rw", encoding="utf-8", errors="replace", newline="\n") as lines,
        ):
            lines.readline()  # the greeting
            lines.write(line + "\n")
            lines.flush()
            answer = lines.readline().strip()
    except OSError as error:
        raise DashboardError(
            f"dashboard server at {address}:{port}: '{line}' got no answer: {error}; is the arm's "
            "controller on, and in remote control?"
        ) from error
    if not answer:
        raise DashboardError(
            f"dashboard server at {address}:{port} closed the connection instead of answering '{line}'"
        )
    return answer
