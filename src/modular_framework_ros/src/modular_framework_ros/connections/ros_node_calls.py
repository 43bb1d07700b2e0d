# SPDX-License-Identifier: BSD-3-Clause
"""Calls the XML-RPC interface of a node with a timeout, for nodes whose process was stopped."""

from __future__ import annotations

import http.client
import xmlrpc.client
from typing import Any

import rosgraph
import rospy


class NodeCallError(Exception):
    """A call of a node failed; the message gives the node and the reason."""


class _Transport(xmlrpc.client.Transport):
    """An XML-RPC transport whose connections have a timeout [s]."""

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
        NodeCallError: The master does not know the node or does not respond.
    """
    try:
        return str(rosgraph.Master(rospy.get_name()).lookupNode(node))
    except (OSError, rosgraph.MasterException) as error:
        raise NodeCallError(f"node '{node}': {error}") from error


def process_id(address: str, timeout_s: float) -> int:
    """Returns the process ID of a node.

    Args:
        address: URI of the node's XML-RPC interface.
        timeout_s: Maximum wait for the connection, and for the response [s].

    Raises:
        NodeCallError: The node does not respond in time.
    """
    return int(_call(address, "getPid", timeout_s))


def published_bytes(address: str, topic: str, timeout_s: float) -> int | None:
    """Returns the total size of the messages that a node has published on a topic since it has a subscriber [bytes].

    A rospy node counts a message once the connections of all subscribers have accepted it, at the end of the publishing
    call.

    Args:
        address: URI of the node's XML-RPC interface.
        topic: Resolved name of the topic.
        timeout_s: Maximum wait for the connection, and for the response [s].

    Returns:
        The byte count; None for nodes that do not count: roscpp nodes, and rospy nodes beyond 2 GiB.

    Raises:
        NodeCallError: The node does not respond in time.
    """
    try:
        publishers = _call(address, "getBusStats", timeout_s)[0]
    except _NodeFault:
        return None
    count = next((item[1] for item in publishers if item[0] == topic), None)
    return count if isinstance(count, int) else None


class _NodeFault(NodeCallError):
    """The node responded with a fault."""


def _call(address: str, method: str, timeout_s: float) -> Any:
    try:
        return getattr(xmlrpc.client.ServerProxy(address, _Transport(timeout_s)), method)(rospy.get_name())[2]
    except xmlrpc.client.Fault as error:
        raise _NodeFault(f"node at {address}: {error}") from error
    except (OSError, xmlrpc.client.Error, http.client.HTTPException, ValueError, IndexError, TypeError) as error:
        raise NodeCallError(f"node at {address}: {error}") from error
