# SPDX-License-Identifier: BSD-3-Clause
"""Only accepts requests with a server's address and token, because any page in a local browser can send requests."""

from __future__ import annotations

import contextlib
import functools
import http
import ipaddress
import secrets
import socket
from collections.abc import Callable, Iterator
from typing import Any

from modular_framework_simulation.errors import SimulationError

_HOSTNAME = socket.gethostname().lower()
_LOCAL_NAMES = ("localhost", _HOSTNAME, f"{_HOSTNAME}.local")
"""Names of this computer; a page that reaches this server through DNS rebinding uses another name."""


class Access:
    """Checks each HTTP request and WebSocket handshake before its server handles it.

    Attributes:
        token: First part of every path; secret, and new at each start.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(16)

    def refusal(self, path: str, host: str, origin: str | None, port: int) -> str:
        """Returns the reason for refusing a request; empty for an accepted request.

        Args:
            path: Path of the request, including the query.
            host: Header Host of the request.
            origin: Header Origin, which browsers add to every WebSocket handshake; None if missing.
            port: Port of the server.
        """
        name, _, given_port = host.lower().rpartition(":")
        if given_port != str(port) or not (name in _LOCAL_NAMES or _is_address(name)):
            return f"Host '{host}' is not this server; allowed: an address or name of this computer, with port {port}"
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            return f"Origin '{origin}' is another page; allowed: http://{host}"
        if not secrets.compare_digest(path.split("?")[0].split("/")[1].encode(), self.token.encode()):
            return "the token is missing or wrong; open the address in the log"
        return ""

    @contextlib.contextmanager
    def enforce_checks(self, **changed: Any) -> Iterator[None]:
        """Makes the server that viser starts in this context check its requests, because viser has no such option.

        Args:
            **changed: Further arguments of `websockets.asyncio.server.serve` that viser does not set.

        Raises:
            SimulationError: The version of viser is not supported, so its server is unchecked.
        """
        from websockets.asyncio import server

        original, started = server.serve, []

        def serve(*args: Any, process_request: Any, **options: Any) -> Any:
            started.append(True)
            return original(*args, process_request=self.checked(process_request), **{**options, **changed})

        server.serve = serve  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            server.serve = original  # type: ignore[misc]
        if not started:
            raise SimulationError("this viser version has an unchecked server; install the version in requirements.txt")

    def checked(self, handler: Callable[..., Any]) -> Callable[..., Any]:
        """Returns a request handler that calls another handler for accepted requests, and refuses all other requests.

        Args:
            handler: The argument `process_request` of `websockets.asyncio.server.serve`.
        """
        return functools.partial(self._process, handler)

    def _process(self, handler: Any, connection: Any, request: Any) -> Any:
        """Responds to a refused request, and forwards an accepted request without its token."""
        host, origins = ",".join(request.headers.get_all("Host")), request.headers.get_all("Origin")
        refusal = self.refusal(request.path, host, ",".join(origins) or None, connection.local_address[1])
        if refusal:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{refusal}\n")
        request.path = request.path.removeprefix(f"/{self.token}") or "/"
        response = handler(connection, request)
        if response is not None:
            response.headers["Referrer-Policy"] = "no-referrer"  # links on the page would reveal the token
        return response


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
