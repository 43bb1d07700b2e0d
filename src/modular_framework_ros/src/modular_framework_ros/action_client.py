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
    which is accepted or ends that early stays pending for ever. This client delays such messages until then. It also
    delays the next goal until the end of the previous goal is stored: `done_cb` is called before that, and a goal sent
    in between would be marked as done. `done_cb` must therefore not wait for another thread that sends a goal.
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
    """Returns whether an action server and a client are connected on all topics of the action, in both directions.

    rospy counts a subscriber's connection before the publisher has accepted it, and a result published until then is
    lost. The publisher's name is known only after that, so the names are compared. Does not use rospy's clock.
    """
    inner = client.action_client
    goal, cancel = (topic.impl for topic in (inner.pub_goal, inner.pub_cancel))
    subscribed = [topic.impl for topic in (inner.status_sub, inner.result_sub, inner.feedback_sub)]
    if None in (goal, cancel, *subscribed):  # unregistered: rospy is shutting down
        return False
    return any(
        cancel.has_connection(server.endpoint_id)
        and all(any(link.callerid_pub == server.endpoint_id for link in topic.connections) for topic in subscribed)
        for server in goal.connections
    )
