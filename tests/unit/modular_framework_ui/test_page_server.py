# SPDX-License-Identifier: BSD-3-Clause
"""The page server: files, refused requests, and messages to fast, late and frozen browsers."""

from __future__ import annotations

import json
import socket
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from modular_framework_simulation.viewer.web_server import free_port
from modular_framework_testing.ros_session import until
from modular_framework_ui.messages import MachineStatus
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.page_source import PageSource
from modular_framework_ui.task_model import TaskModel

WEB = Path(__file__).parents[3] / "src" / "modular_framework_ui" / "web"


class Served:
    """A server with its model."""

    def __init__(self) -> None:
        self.model = TaskModel(time.monotonic, lambda: self.server.notify())
        self.server = PageServer(WEB, PageSource(self.model.changes_since), "127.0.0.1", free_port("127.0.0.1", 8970))
        self.server.start()

    @property
    def live(self) -> str:
        return f"{self.server.address.replace('http:', 'ws:')}live"

    def run_state(self, label: str) -> None:
        self.model.note_status(MachineStatus(path="/pick", initial=(), active=(label,)))


@pytest.fixture
def served() -> Iterator[Served]:
    served = Served()
    yield served
    served.server.close()


def message(browser: ClientConnection) -> dict[str, Any]:
    return dict(json.loads(browser.recv(timeout=20.0)))


def test_the_page_and_its_files_are_served_with_a_policy_that_forbids_other_code(served: Served) -> None:
    script = "text/javascript"
    for name, kind in (("", "text/html"), ("page.js", script), ("plots.js", script), ("page.css", "text/css")):
        with urllib.request.urlopen(served.server.address + name, timeout=5.0) as answer:
            assert answer.headers["Content-Type"].startswith(kind)
            assert "script-src 'self'" in answer.headers["Content-Security-Policy"]
            assert answer.headers["Referrer-Policy"] == "no-referrer"
            assert answer.read() == (WEB / (name or "index.html")).read_bytes()


@pytest.mark.parametrize("path", ["../package.xml", "%2e%2e/package.xml", "page.py", "web/page.js", "/etc/passwd"])
def test_no_other_file_is_served(served: Served, path: str) -> None:
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(served.server.address + path, timeout=5.0)
    assert refused.value.code == 404


def test_requests_without_the_token_and_from_other_pages_are_refused(served: Served) -> None:
    address = served.server.address
    root = address.rpartition("/")[0].rpartition("/")[0]
    for url, headers in (
        (f"{root}/", {}),
        (f"{root}/wrong/page.js", {}),
        (address, {"Host": f"evil.example:{served.server.port}"}),
        (address, {"Origin": "http://evil.example"}),
    ):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=5.0)
        assert refused.value.code == 403
    with pytest.raises(InvalidStatus):
        connect(served.live, origin="http://evil.example")  # type: ignore[arg-type]


def test_a_browser_receives_the_state_so_far_and_then_each_change(served: Served) -> None:
    served.run_state("Look")
    with connect(served.live) as early:
        assert [run["path"] for run in message(early)["runs"]] == ["/pick/Look"]
        served.run_state("Hold")
        assert {run["path"]: run["end_s"] is None for run in message(early)["runs"]} == {
            "/pick/Look": False,
            "/pick/Hold": True,
        }
        with connect(served.live) as late:
            assert [run["path"] for run in message(late)["runs"]] == ["/pick/Look", "/pick/Hold"]


def test_a_page_that_sends_something_is_disconnected(served: Served) -> None:
    with connect(served.live) as browser:
        browser.send("stop")
        with pytest.raises(ConnectionClosed, match="read-only"):
            while True:
                browser.recv(timeout=20.0)


def open_frozen(served: Served) -> socket.socket:
    """The WebSocket of a frozen browser, which reads only the first bytes."""
    server = served.server
    frozen = socket.socket()
    frozen.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    frozen.settimeout(20.0)
    frozen.connect((server.host, server.port))
    path = urllib.parse.urlsplit(served.live).path
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    key = f"Sec-WebSocket-Key: {'a' * 22}==\r\n"
    frozen.sendall(f"GET {path} HTTP/1.1\r\nHost: {server.host}:{server.port}\r\n{upgrade}{key}\r\n".encode())
    assert frozen.recv(12) == b"HTTP/1.1 101"
    return frozen


def test_a_frozen_browser_delays_neither_the_model_nor_others_nor_the_end(served: Served) -> None:
    with open_frozen(served), connect(served.live, max_size=None) as browser:
        message(browser)
        for number in range(200):
            served.model.note_log("WARN", "/arm", f"{number} {'x' * 50_000}")  # 10 MB, more than the socket's buffers
        received: list[str] = []

        def is_last() -> bool:
            received.extend(line["text"] for line in message(browser)["log"])
            return received[-1].startswith("199 ")

        until(is_last, "the last line arrives")
        assert [text.split()[0] for text in received] == [str(number) for number in range(200)]
        served.server.close()
    served.server.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((served.server.host, served.server.port), 5.0)


def test_a_port_that_is_taken_is_reported(served: Served) -> None:
    second = PageServer(WEB, PageSource(served.model.changes_since), "127.0.0.1", served.server.port)
    with pytest.raises(OSError, match=str(served.server.port)):
        second.start()
