# SPDX-License-Identifier: BSD-3-Clause
"""A simple action client that does not lose the answer of a fast server."""

from __future__ import annotations

import threading
from typing import Any

import actionlib
from actionlib.action_client import ClientGoalHandle


class SteadyActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient for servers that answer at once.

    actionlib's own client knows its goal only when `send_goal` has returned, and drops whatever the server says before
    that: a goal accepted or ended within that time stays pending for ever. This one lets such an answer wait. It also
    lets the next goal wait until the end of the one before is noted: `done_cb` is called first, and a goal sent then
    would be marked as done. So `done_cb` must not wait for another thread that sends a goal.
    """

    def __init__(self, ns: str, action_spec: type[Any]) -> None:
        self._sending = threading.RLock()
        super().__init__(ns, action_spec)

    def send_goal(self, *args: Any, **kwargs: Any) -> None:
        """Sends a goal; arguments as those of actionlib.SimpleActionClient.send_goal."""
        with self._sending:
            super().send_goal(*args, **kwargs)

    def _handle_transition(self, gh: ClientGoalHandle) -> None:
        with self._sending:
            if gh == self.gh:
                super()._handle_transition(gh)


def is_connected(client: actionlib.SimpleActionClient) -> bool:
    """Whether an action server and a client are connected on all topics of the action, in both directions.

    rospy counts the connection of a subscriber before it is made: a result published until then is lost. Only when the
    publisher has answered is its name known, so the names are compared. Asks without rospy's clock.
    """
    inner = client.action_client
    goal, cancel = (topic.impl for topic in (inner.pub_goal, inner.pub_cancel))
    heard = [topic.impl for topic in (inner.status_sub, inner.result_sub, inner.feedback_sub)]
    if None in (goal, cancel, *heard):  # unregistered: rospy is shutting down
        return False
    return any(
        cancel.has_connection(server.endpoint_id)
        and all(any(link.callerid_pub == server.endpoint_id for link in topic.connections) for topic in heard)
        for server in goal.connections
    )
