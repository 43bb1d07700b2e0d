# SPDX-License-Identifier: BSD-3-Clause
"""Detects when an action client has sent a goal completely, so that the server's reports reach it.

actionlib's SimpleActionClient ignores messages about a goal until send_goal() has returned, and logs an error. The
server receives the goal earlier: rospy passes the message to a thread of the connection, yields the processor, and
counts the bytes of the message only when the sending thread runs again. From then on, this thread needs neither the
network nor a lock, and Python does not interrupt a running thread for 5 ms. The server therefore waits until the
client's node has counted the message. No stronger guarantee is possible: a client sends its responses from a different
thread, which the operating system may interrupt at any point.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from typing import Any

import rospy
from rosgraph.network import encode_ros_handshake_header

from modular_framework_ros.connections.ros_node_calls import NodeCallError, node_address, published_bytes

CLIENT_TIMEOUT_S = 0.5
"""Maximum wait for a client whose node does not respond or does not count the goal [s]."""
_PAUSE_S = 0.002
_BLIND_CALLS = 3
"""Number of responses after which a goal counts as sent if the expected byte count is unknown."""


@dataclass(slots=True, eq=False)
class _Sender:
    """Connection of a client.

    Attributes:
        connection: rospy transport of the goal topic.
        address: URI of the XML-RPC interface of the client's node.
        difference: Bytes published by the client minus bytes counted by the transport; None if unknown.
    """

    connection: Any
    address: str = ""
    difference: int | None = None


class GoalSenders:
    """The clients of one action server.

    Args:
        goals: Subscriber of the goal topic.
    """

    def __init__(self, goals: rospy.Subscriber) -> None:
        self._goals = goals
        self._senders: dict[str, _Sender] = {}

    def received_bytes(self, goal: Any) -> int:
        """Returns the transport's byte count when a goal arrives; call it in the subscriber's thread."""
        client = goal._connection_header["callerid"]
        connection = next((item for item in self._goals.impl.connections if item.callerid_pub == client), None)
        sender = self._senders.get(client)
        if sender is None or sender.connection is not connection:
            sender = self._senders[client] = _Sender(connection)
        if connection is None:  # already closed
            return 0
        if goal.header.seq == 1:  # the client's first message; num_messages also counts the transport's header
            sender.difference = -len(encode_ros_handshake_header(connection.protocol.get_header_fields()))
        return int(connection.stat_bytes)

    def wait(self, client: str, received: int) -> None:
        """Waits until a client has sent a goal completely or does not respond.

        Args:
            client: Name of the client's node.
            received: Byte count when the goal arrived.
        """
        sender, end_s = self._senders[client], time.monotonic() + CLIENT_TIMEOUT_S
        try:
            sender.address = sender.address or node_address(client)
            for call in itertools.count(1):
                published = published_bytes(sender.address, self._goals.resolved_name, CLIENT_TIMEOUT_S)
                is_known = published is not None and sender.difference is not None
                if is_known and published >= received + sender.difference:
                    return
                if time.monotonic() > end_s or (call == _BLIND_CALLS and not is_known):
                    sender.difference = None if published is None else published - received
                    return
                time.sleep(_PAUSE_S)
        except NodeCallError as error:
            sender.address = ""
            rospy.logdebug("a goal is reported though its client did not answer: %s", error)
