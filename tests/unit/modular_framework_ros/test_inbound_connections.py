# SPDX-License-Identifier: BSD-3-Clause
"""A node's server of topics and services, beside clients that send nothing."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from queue import Queue
from typing import Any

import pytest
from rosgraph.network import write_ros_handshake_header
from rospy.impl import tcpros_base

from modular_framework_ros.connections.inbound_connections import BACKLOG, accept_connections_at_once


class Node:
    """The server of topics and services of a node."""

    def __init__(self, server: tcpros_base.TCPROSServer) -> None:
        self.headers: Queue[dict[str, str]] = Queue()
        self.server = server
        self.server.topic_connection_handler = self._accept

    def _accept(self, client: Any, address: Any, header: dict[str, str]) -> None:
        del client, address
        self.headers.put(header)

    def connection(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.server.tcp_ros_server.port), timeout=10.0)


@pytest.fixture(autouse=True)
def local(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    monkeypatch.setattr(tcpros_base, "TCPServer", tcpros_base.TCPServer)  # restored after the test


@pytest.fixture
def new_node() -> Iterator[Node]:
    """A node that starts its server after the call of `accept_connections_at_once`."""
    accept_connections_at_once()
    node = Node(tcpros_base.TCPROSServer())
    node.server.start_server()
    yield node
    node.server.shutdown()


@pytest.fixture
def running_node() -> Iterator[Node]:
    """A node whose server runs before the call of `accept_connections_at_once`."""
    node = Node(tcpros_base.init_tcpros_server())  # the server of this process
    node.server.start_server()
    accept_connections_at_once()
    accept_connections_at_once()
    yield node
    node.server.shutdown()


@pytest.mark.parametrize("kind", ["new_node", "running_node"])
def test_a_subscriber_is_accepted_while_another_client_sends_no_header(
    kind: str, request: pytest.FixtureRequest
) -> None:
    node: Node = request.getfixturevalue(kind)
    with node.connection(), node.connection() as other_protocol, node.connection() as subscriber:
        other_protocol.sendall(b"POST /RPC2 HTTP/1.1\r\n\r\n")
        write_ros_handshake_header(subscriber, {"topic": "/joint_states"})
        assert node.headers.get(timeout=10.0) == {"topic": "/joint_states"}


@pytest.mark.parametrize("reset", [False, True])
def test_a_connection_that_its_client_closes_unused_is_no_warning(
    new_node: Node, reset: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Subscribers of rospy close such connections, for example after they learned of a publisher twice."""
    warnings: list[str] = []
    monkeypatch.setattr(tcpros_base, "logwarn", lambda text, *values: warnings.append(text % values))
    unused = new_node.connection()
    if reset:
        unused.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    unused.close()
    with new_node.connection() as incomplete:
        incomplete.sendall(b"\0")
    deadline = time.monotonic() + 10.0
    while (not warnings or threads_of_connections()) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert len(warnings) == 1 and "1 bytes were received" in warnings[0], warnings


def threads_of_connections() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "inbound_connection"]


def test_many_connections_may_be_pending(new_node: Node) -> None:
    clients = [new_node.connection() for _ in range(BACKLOG)]
    for number, client in enumerate(clients):
        write_ros_handshake_header(client, {"topic": f"/topic_{number}"})
    assert {new_node.headers.get(timeout=10.0)["topic"] for _ in clients} == {f"/topic_{n}" for n in range(BACKLOG)}
    for client in clients:
        client.close()
