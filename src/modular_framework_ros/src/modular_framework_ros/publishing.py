# SPDX-License-Identifier: BSD-3-Clause
"""Publishes during the shutdown of the node without useless errors, and draws pictures only for subscribers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy


def going_down() -> bool:
    """Whether the node is being shut down: rospy closes the topics before it says so by is_shutdown()."""
    return bool(rospy.core.is_shutdown_requested())


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publishes a message; a topic that is closed because the node shuts down is no error.

    Raises:
        rospy.ROSException: the topic is closed, or the message does not fit, while the node runs on.
    """
    try:
        publisher.publish(message)
    except rospy.ROSException as error:
        if not going_down():
            raise
        rospy.logdebug("topic %s is closed: %s", publisher.name, error)


class PicturePublisher(rospy.SubscribeListener):
    """A latched topic whose message is drawn only for subscribers.

    Drawing the markers of a planned path takes longer than an easy plan.

    Args:
        name: Topic.
        kind: Message type.
    """

    def __init__(self, name: str, kind: Any) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._draw: Callable[[], Any] | None = None
        self._publisher = rospy.Publisher(name, kind, subscriber_listener=self, latch=True, queue_size=1)

    def show(self, draw: Callable[[], Any]) -> None:
        """Replaces the picture.

        Args:
            draw: Returns the message; called now if there are subscribers, or else once the first one comes.
        """
        with self._lock:
            if self._publisher.get_num_connections() > 0:
                publish(self._publisher, draw())
            else:
                self._draw = draw

    def peer_subscribe(self, _topic: str, _publish: Any, _peer_publish: Any) -> None:
        """Called by rospy before it sends the latched message to a new subscriber."""
        with self._lock:
            if self._draw is not None:
                self._publisher.impl.latch, self._draw = self._draw(), None
