# SPDX-License-Identifier: BSD-3-Clause
"""Accepts all connections to a node's topics and services at once.

rospy reads the header of a connection before it accepts the next one. A client that sends nothing or another protocol,
such as a port scanner or a caller of a dead node whose port is used again, would keep all further clients waiting until
it closes its connection. In addition, rospy's queue holds five pending connections, and every service call opens one or
two connections: Linux drops the sixth connection, and its client retries after a second.

A connection that its client closes before it sends a byte is closed without a warning. rospy's subscribers open such
connections: a subscriber that learns of a publisher twice, from the reply to its registration and from the master's
update, opens two connections and closes the first.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable

from rospy.impl import tcpros_base

BACKLOG = 128
"""Number of pending connections."""
_Handler = Callable[[socket.socket, tuple[str, int]], None]


class _ParallelServer(tcpros_base.TCPServer):  # type: ignore[misc]
    def __init__(self, inbound_handler: _Handler, port: int = 0) -> None:
        super().__init__(inbound_handler, port)
        self.accept_at_once()

    def accept_at_once(self) -> None:
        """Calls the handler of each connection on a thread of its own."""
        self.inbound_handler = _on_own_thread(self.inbound_handler)
        self.server_sock.listen(BACKLOG)  # the length of the queue may be changed at any time


def accept_connections_at_once() -> None:
    """Reads the header of each connection on a thread of its own; call before or after rospy.init_node, or both."""
    tcpros_base.TCPServer = _ParallelServer
    running = getattr(getattr(tcpros_base, "_tcpros_server", None), "tcp_ros_server", None)
    if running is not None and not isinstance(running, _ParallelServer):
        running.__class__ = _ParallelServer
        running.accept_at_once()


def _on_own_thread(handler: _Handler) -> _Handler:
    def handle(client: socket.socket, address: tuple[str, int]) -> None:
        threading.Thread(target=accept, args=(client, address), name="inbound_connection", daemon=True).start()

    def accept(client: socket.socket, address: tuple[str, int]) -> None:
        if _is_unused(client):
            client.close()
        else:
            handler(client, address)

    return handle


def _is_unused(client: socket.socket) -> bool:
    """Waits for the first byte; returns True if the client closed the connection or the socket's timeout passed."""
    try:
        return not client.recv(1, socket.MSG_PEEK)
    except OSError:
        return True
