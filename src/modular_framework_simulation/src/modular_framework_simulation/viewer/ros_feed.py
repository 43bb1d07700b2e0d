# SPDX-License-Identifier: BSD-3-Clause
"""Subscribes to topics only while a browser is connected."""

from __future__ import annotations

from collections import deque
from typing import Any

import rospy

_BUFFER_BYTES = 1 << 24
"""Buffer for a whole image; with a smaller buffer, rospy falls behind."""


class Feed:
    """Queue of unread messages of a topic.

    Args:
        topic: Name of the topic.
        kind: Message type of the topic.
        keep: Maximum number of queued messages; the oldest messages are dropped.
    """

    def __init__(self, topic: str, kind: Any, keep: int = 1) -> None:
        self._topic, self._kind, self._keep = topic, kind, keep
        self._queue: deque[Any] = deque(maxlen=keep)
        self._subscriber: Any = None

    @property
    def topic(self) -> str:
        """Returns the name of the topic."""
        return self._topic

    def switch(self, on: bool) -> None:
        """Subscribes or unsubscribes; does nothing without a change."""
        if on and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self._topic, self._kind, self._queue.append, queue_size=self._keep, buff_size=_BUFFER_BYTES
            )
        elif not on and self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
            self._queue.clear()

    def take(self) -> list[Any]:
        """Returns and removes the queued messages, oldest first."""
        messages = []
        while self._queue:
            messages.append(self._queue.popleft())
        return messages
