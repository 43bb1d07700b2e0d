# SPDX-License-Identifier: BSD-3-Clause
"""Publishes without errors during the shutdown of a node, and creates visualisation messages only for subscribers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy


def going_down() -> bool:
    """Returns whether the node is shutting down; rospy closes the topics before is_shutdown() returns True."""
    return bool(rospy.core.is_shutdown_requested())


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publishes a message and ignores topics that are closed because the node shuts down.

    Raises:
        rospy.ROSException: The topic is closed or the message does not fit its type, while the node runs.
    """
    try:
        publisher.publish(message)
    except rospy.ROSException as error:
        if not going_down():
            raise
        rospy.logdebug("topic %s is closed: %s", publisher.name, error)


class PicturePublisher(rospy.SubscribeListener):
    """A latched topic whose message is created only for subscribers.

    The markers of a planned path take longer to create than an easy plan.

    Args:
        name: Name of the topic.
        kind: Message type.
    """

    def __init__(self, name: str, kind: Any) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._draw: Callable[[], Any] | None = None
        self._publisher = rospy.Publisher(name, kind, subscriber_listener=self, latch=True, queue_size=1)

    def show(self, draw: Callable[[], Any]) -> None:
        """Replaces the message.

        Args:
            draw: Function that creates the message, called now if the topic has subscribers and otherwise for the first
                new subscriber.
        """
        with self._lock:
            if self._publisher.get_num_connections() > 0:
                self._draw = None  # rospy may report the first subscriber only after this message
                publish(self._publisher, draw())
            else:
                self._draw = draw

    def peer_subscribe(self, _topic: str, _publish: Any, _peer_publish: Any) -> None:
        """Creates the message before rospy sends the latched message to a new subscriber.

        Args:
            _topic: Name of the topic.
            _publish: Function that publishes to all subscribers.
            _peer_publish: Function that publishes to the new subscriber.
        """
        with self._lock:
            if self._draw is not None:
                self._publisher.impl.latch, self._draw = self._draw(), None
