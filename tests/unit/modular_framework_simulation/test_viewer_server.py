# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's server beside browsers that are slow, frozen or idle."""

from __future__ import annotations

import socket
import urllib.parse
from collections.abc import Iterator

import pytest
import viser
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from modular_framework_simulation.viewer.web_server import WebServer, free_port
from modular_framework_testing.ros_session import until

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


@pytest.fixture
def server() -> Iterator[WebServer]:
    server = WebServer("127.0.0.1", free_port("127.0.0.1", 8950))
    yield server
    server.close()


def websocket(server: WebServer) -> str:
    return server.address.replace("http:", "ws:").rstrip("/")


def test_a_browser_counts_before_it_has_rendered_anything(server: WebServer) -> None:
    assert not server.has_clients
    with connect(websocket(server), subprotocols=[PROTOCOL], max_size=None, compression=None):
        until(lambda: server.has_clients, "the browser counts")
    until(lambda: not server.has_clients, "the browser has gone")


def open_frozen(server: WebServer) -> socket.socket:
    """The WebSocket of a frozen browser, which reads no more than the first bytes."""
    path = urllib.parse.urlsplit(websocket(server)).path
    frozen = socket.socket()
    frozen.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    frozen.settimeout(20.0)
    frozen.connect((server.host, server.port))
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    key = f"Sec-WebSocket-Key: {'a' * 22}==\r\nSec-WebSocket-Protocol: {PROTOCOL}\r\n"
    frozen.sendall(f"GET {path} HTTP/1.1\r\nHost: {server.host}:{server.port}\r\n{upgrade}{key}\r\n".encode())
    assert frozen.recv(12) == b"HTTP/1.1 101"
    return frozen


def test_the_end_of_the_server_waits_for_no_browser(server: WebServer) -> None:
    server.viser.scene.add_glb("/large", bytes(4_000_000))  # more than the buffers of a socket
    idle = socket.create_connection((server.host, server.port), 20.0)  # opened in advance, as browsers do
    with open_frozen(server), idle:
        until(lambda: server.has_clients, "the frozen browser counts")
        server.close()
        idle.setblocking(False)
        assert idle.recv(1) == b""  # the end of the connection; an open connection raises BlockingIOError
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((server.host, server.port), 20.0)
