# SPDX-License-Identifier: BSD-3-Clause
"""Keeps track of all TCP connections to the page, because viser only counts browsers that have rendered the scene."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State


class PageConnections:
    """Registry of connections, from their first byte to their last; all methods may be called by any thread.

    A browser with a slow graphics driver receives the panel long before it renders its first frame. A browser that no
    longer reads, or an idle connection that a browser opened in advance, would delay the end of the server by its
    timeouts of 10 s and more.
    """

    def __init__(self) -> None:
        self._connections: set[ServerConnection] = set()
        self._is_closed = False

    @property
    def has_browser(self) -> bool:
        """Returns whether a WebSocket is open."""
        return any(connection.state is State.OPEN for connection in tuple(self._connections))

    def create_connection(self, *args: Any, **options: Any) -> ServerConnection:
        """Creates a registered connection; the argument `create_connection` of `websockets.asyncio.server.serve`."""
        return _RegisteredConnection(self, *args, **options)

    def close(self, loop: asyncio.AbstractEventLoop) -> None:
        """Drops all connections, and each later connection at once, without waiting for browsers. May be called twice.

        Args:
            loop: Event loop of the server.
        """
        with contextlib.suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(self._abort)

    def add(self, connection: ServerConnection) -> None:
        """Registers a new connection."""
        self._connections.add(connection)
        if self._is_closed:
            connection.transport.abort()

    def discard(self, connection: ServerConnection) -> None:
        """Removes a lost connection."""
        self._connections.discard(connection)

    def _abort(self) -> None:
        self._is_closed = True
        for connection in tuple(self._connections):
            connection.transport.abort()


class _RegisteredConnection(ServerConnection):
    def __init__(self, registry: PageConnections, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._registry = registry

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._registry.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._registry.discard(self)
        super().connection_lost(exc)
