# SPDX-License-Identifier: BSD-3-Clause
"""Calls of a node's XML-RPC interface that do not wait for ever for a node whose process was stopped."""

from __future__ import annotations

import http.client
import xmlrpc.client
from typing import Any

import rosgraph
import rospy


class NodeCallError(Exception):
    """A node could not be called; the text names the node and says why."""


class _Transport(xmlrpc.client.Transport):
    """Opens connections with a timeout [s]."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Returns a connection with the timeout."""
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def node_address(node: str) -> str:
    """Returns the URI of a node's XML-RPC interface.

    Args:
        node: Name of the node.

    Raises:
        NodeCallError: The master does not know the node, or does not answer.
    """
    try:
        return str(rosgraph.Master(rospy.get_name()).lookupNode(node))
    except (OSError, rosgraph.MasterException) as error:
        raise NodeCallError(f"node '{node}': {error}") from error


def process_id(address: str, timeout_s: float) -> int:
    """Asks a node for the number of its process.

    Args:
        address: URI of the node's XML-RPC interface.
        timeout_s: Longest wait for the connection, and for the answer [s].

    Raises:
        NodeCallError: The node does not answer in time.
    """
    return int(_call(address, "getPid", timeout_s))


def published_bytes(address: str, topic: str, timeout_s: float) -> int | None:
    """Asks a node for the size of all messages that it has published on a topic since it has a subscriber [bytes].

    A node of rospy counts a message at the end of the publishing thread's work, once all subscribers' connections have
    taken the message.

    Args:
        address: URI of the node's XML-RPC interface.
        topic: Resolved name of the topic.
        timeout_s: Longest wait for the connection, and for the answer [s].

    Returns:
        The count. None if the node does not count: nodes of roscpp, and nodes of rospy beyond 2 GiB.

    Raises:
        NodeCallError: The node does not answer in time.
    """
    try:
        publishers = _call(address, "getBusStats", timeout_s)[0]
    except _NodeFault:
        return None
    count = next((item[1] for item in publishers if item[0] == topic), None)
    return count if isinstance(count, int) else None


class _NodeFault(NodeCallError):
    """The node answered with a fault."""


def _call(address: str, method: str, timeout_s: float) -> Any:
    try:
        return getattr(xmlrpc.client.ServerProxy(address, _Transport(timeout_s)), method)(rospy.get_name())[2]
    except xmlrpc.client.Fault as error:
        raise _NodeFault(f"node at {address}: {error}") from error
    except (OSError, xmlrpc.client.Error, http.client.HTTPException, ValueError, IndexError, TypeError) as error:
        raise NodeCallError(f"node at {address}: {error}") from error
