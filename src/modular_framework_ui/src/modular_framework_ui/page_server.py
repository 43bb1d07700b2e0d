# SPDX-License-Identifier: BSD-3-Clause
"""Web server of the page: files over HTTP, and the state of the task over a WebSocket.

A slow browser does not delay the node or other browsers. After a message is sent, the next message of the connection
contains all changes since then.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import threading
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from modular_framework_simulation.viewer.access import Access
from modular_framework_simulation.viewer.page_connections import PageConnections
from modular_framework_ui.page_protocol import changes_text, fault_text, shown_time
from modular_framework_ui.page_source import PAIR_PAGE, RUN_PAGE, TASK_PAGE, PageSource, Query
from modular_framework_ui.recorded_task import ReplayError

LIVE_PATH, TABLE_PATH = "/live", "/run.json"
_HTML, _SCRIPT = "text/html; charset=utf-8", "text/javascript; charset=utf-8"
FILES = {
    TASK_PAGE: ("index.html", _HTML),
    RUN_PAGE: ("episodes.html", _HTML),
    PAIR_PAGE: ("pair.html", _HTML),
    "/page.js": ("page.js", _SCRIPT),
    "/plots.js": ("plots.js", _SCRIPT),
    "/pair_link.js": ("pair_link.js", _SCRIPT),
    "/player.js": ("player.js", _SCRIPT),
    "/episodes.js": ("episodes.js", _SCRIPT),
    "/pair.js": ("pair.js", _SCRIPT),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/uPlot.js": ("uPlot/uPlot.iife.min.js", _SCRIPT),
    "/uPlot.css": ("uPlot/uPlot.min.css", "text/css; charset=utf-8"),
}
"""File name and MIME type, keyed by URL path; the server serves no other files."""
MIN_PERIOD_S = 1 / 30
"""Minimum time between two messages of a connection [s]."""
MAX_REQUEST_BYTES = 1024
START_TIMEOUT_S = 10.0
_REFUSED, _REFUSAL = 1008, "the page is read-only except for the time of a recorded world"
"""WebSocket close code and reason for a page that sends another message."""


class PageServer:
    """Serves the page in a separate thread. A page can only choose the time of a recorded world.

    Args:
        folder: Folder with the files of the page.
        source: Contents of the page.
        host: Address of the server.
        port: Unused port.
    """

    def __init__(self, folder: Path, source: PageSource, host: str, port: int) -> None:
        self._files = {path: ((folder / name).read_bytes(), kind) for path, (name, kind) in FILES.items()}
        self._source = source
        self.host, self.port = host, port
        self._access, self._connections = Access(), PageConnections()
        self._loop = asyncio.new_event_loop()
        self._changed: set[asyncio.Event] = set()
        self._started, self._ended = threading.Event(), asyncio.Event()
        self._fault: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="page server", daemon=True)

    @property
    def address(self) -> str:
        """Returns the URL of the page."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/{self._access.token}/"

    def start(self) -> None:
        """Starts the server.

        Raises:
            OSError: The server cannot listen at its address, or does not start in time.
        """
        self._thread.start()
        if not self._started.wait(START_TIMEOUT_S):
            raise TimeoutError(f"the server does not listen on {self.host}:{self.port} after {START_TIMEOUT_S:g} s")
        if self._fault is not None:
            raise self._fault

    def notify(self) -> None:
        """Wakes all connections so that they send the changes. Thread-safe; does not wait for browsers."""
        with contextlib.suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._set_changed)

    def close(self) -> None:
        """Stops the server and its source without waiting for browsers. May be called twice."""
        self._connections.close(self._loop)
        with contextlib.suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._ended.set)
        if self._thread.is_alive():
            self._thread.join(START_TIMEOUT_S)
        self._source.close()

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            self._fault = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        create_connection: Any = self._connections.create_connection  # annotated as a class; any factory works
        async with serve(
            self._send_changes,
            self.host,
            self.port,
            process_request=self._access.checked(self._respond),
            create_connection=create_connection,
            max_size=MAX_REQUEST_BYTES,
        ):
            self._started.set()
            await self._ended.wait()

    def _set_changed(self) -> None:
        for event in self._changed:
            event.set()

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """Returns the response to an HTTP request; None for the handshake of the WebSocket."""
        path, query = urlsplit(request.path).path, _query(request)
        if path == LIVE_PATH:
            return None
        if path == TABLE_PATH:
            try:
                content, kind = self._source.table(query).encode(), "application/json"
            except ReplayError as error:
                return connection.respond(http.HTTPStatus.NOT_FOUND, f"{error}\n")
        elif path in self._files:
            content, kind = self._files[self._source.page(query) if path == TASK_PAGE else path]
        else:
            return connection.respond(http.HTTPStatus.NOT_FOUND, f"there is no file {path}\n")
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Content-Security-Policy": _content_policy(request.headers["Host"]),
            "X-Content-Type-Options": "nosniff",
            "Cache-Control": "no-store",
            "Connection": "close",
        }
        return Response(200, "OK", Headers(headers), content)

    async def _send_changes(self, connection: ServerConnection) -> None:
        """Sends changes until the page disconnects."""
        changed = asyncio.Event()
        changed.set()
        self._changed.add(changed)
        reader = asyncio.create_task(self._read_times(connection, changed))
        try:
            assert connection.request is not None
            query = _query(connection.request)
            changes_since = await asyncio.to_thread(self._source.changes, query)
            revision = 0
            while True:
                await changed.wait()
                changed.clear()
                changes = changes_since(revision)
                revision = changes.revision
                await connection.send(changes_text(changes))
                await asyncio.sleep(MIN_PERIOD_S)
        except ReplayError as error:
            with contextlib.suppress(ConnectionClosed):
                await connection.send(fault_text(str(error)))
        except ConnectionClosed:
            pass
        finally:
            reader.cancel()
            self._changed.discard(changed)

    async def _read_times(self, connection: ServerConnection, changed: asyncio.Event) -> None:
        """Shows the recorded world at the times that the page sends; refuses any other message.

        Args:
            connection: Connection of the page.
            changed: Event for which the sender waits; set at the end of the connection.
        """
        assert connection.request is not None
        query = _query(connection.request)
        try:
            while True:
                time_s = shown_time(await connection.recv())
                await asyncio.to_thread(self._source.show, query, time_s)  # may wait for an episode that is being read
        except ReplayError:
            await connection.close(_REFUSED, _REFUSAL)
        except ConnectionClosed:
            pass
        finally:
            changed.set()


def _query(request: Request) -> Query:
    return dict(parse_qsl(urlsplit(request.path).query))


def _content_policy(host: str) -> str:
    """Returns the content security policy: files of this server, and frames of this computer for the world view.

    Only pages of this server may contain its pages as frames; the page of a pair does.
    """
    name = host.rpartition(":")[0]
    frames = " ".join(f"http://{each}:*" for each in (name, "localhost", "127.0.0.1"))
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
        f"connect-src 'self' ws://{host}; frame-src 'self' {frames}; frame-ancestors 'self'; base-uri 'none'"
    )
