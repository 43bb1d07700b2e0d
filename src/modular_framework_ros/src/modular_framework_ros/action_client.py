# SPDX-License-Identifier: BSD-3-Clause
"""A simple action client that keeps the early messages of a fast server."""

from __future__ import annotations

import threading
from typing import Any

import actionlib
from actionlib.action_client import ClientGoalHandle


class SteadyActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient for servers that answer at once.

    actionlib's client discards every message of the server that arrives before `send_goal` has returned, so that a goal
    that is accepted or ends that early stays pending forever. This client delays such messages until then. It also
    delays the next goal until the end of the previous goal is stored: `done_cb` is called earlier, and a goal sent in
    between would be marked as done. `done_cb` must therefore not wait for another thread that sends a goal.
    """

    def __init__(self, ns: str, action_spec: type[Any]) -> None:
        self._sending = threading.RLock()
        super().__init__(ns, action_spec)

    def send_goal(self, *args: Any, **kwargs: Any) -> None:
        """Sends a goal; the arguments are those of actionlib.SimpleActionClient.send_goal."""
        with self._sending:
            super().send_goal(*args, **kwargs)

    def _handle_transition(self, gh: ClientGoalHandle) -> None:
        with self._sending:
            if gh == self.gh:
                super()._handle_transition(gh)


def is_connected(client: actionlib.SimpleActionClient) -> bool:
    """Returns whether an action server and a client are connected on all topics of the action, in both directions."""
    return not unconnected_topics(client)


def unconnected_topics(client: actionlib.SimpleActionClient) -> list[str]:
    """Returns the topics of an action on which client and server are not connected; empty if all are connected.

    rospy counts a subscriber's connection before the publisher has accepted it, and a result published until then is
    lost. The publisher's name is known only after that, so the names are compared. Does not use rospy's clock. With
    several servers, the result is about the server with the most connected topics.
    """
    inner = client.action_client
    published, subscribed = (inner.pub_goal, inner.pub_cancel), (inner.status_sub, inner.result_sub, inner.feedback_sub)
    names = [topic.name for topic in (*published, *subscribed)]
    topics = [topic.impl for topic in (*published, *subscribed)]
    if None in topics:  # unregistered: rospy is shutting down
        return names
    peers = [{connection.endpoint_id for connection in topic.connections} for topic in topics[: len(published)]]
    peers += [{connection.callerid_pub for connection in topic.connections} for topic in topics[len(published) :]]
    unconnected = [
        [name for name, nodes in zip(names, peers, strict=True) if server not in nodes] for server in peers[0]
    ]
    return min(unconnected, key=len, default=names)
