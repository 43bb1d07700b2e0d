# SPDX-License-Identifier: BSD-3-Clause
"""Sends requests to the dashboard server of a UR arm."""

from __future__ import annotations

import socket

DASHBOARD_PORT = 29999


class DashboardError(Exception):
    """Raised if the dashboard server does not respond."""


def request_dashboard(address: str, line: str, timeout_s: float = 2.0, port: int = DASHBOARD_PORT) -> str:
    """Sends one request and returns the response.

    Args:
        address: Address of the arm's controller.
        line: Request, such as "unlock protective stop".
        timeout_s: Timeout of the connection and of each response [s].
        port: Port of the dashboard server.

    Raises:
        DashboardError: If the server cannot be reached or does not respond in time.
    """
    try:
        with (
            socket.create_connection((address, port), timeout_s) as connection,
            connection.makefile("rw", encoding="utf-8", errors="replace", newline="\n") as lines,
        ):
            lines.readline()  # the greeting
            lines.write(line + "\n")
            lines.flush()
            response = lines.readline().strip()
    except OSError as error:
        raise DashboardError(
            f"dashboard server at {address}:{port}: '{line}' got no answer: {error}; is the arm's "
            "controller on, and in remote control?"
        ) from error
    if not response:
        raise DashboardError(
            f"dashboard server at {address}:{port} closed the connection instead of answering '{line}'"
        )
    return response
