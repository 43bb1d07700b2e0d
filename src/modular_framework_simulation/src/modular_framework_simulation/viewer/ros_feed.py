# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are subscribed to only while somebody looks."""

from __future__ import annotations

from collections import deque
from typing import Any

import rospy

_BUFFER_BYTES = 1 << 24
"""Room for a whole image, without which rospy gets behind."""


class Feed:
    """The messages of a topic that have not been taken yet.

    Args:
        topic: Its name.
        kind: Its type.
        keep: How many messages wait at most; the oldest are dropped.
    """

    def __init__(self, topic: str, kind: Any, keep: int = 1) -> None:
        self._topic, self._kind, self._keep = topic, kind, keep
        self._waiting: deque[Any] = deque(maxlen=keep)
        self._subscriber: Any = None

    @property
    def topic(self) -> str:
        """Its name."""
        return self._topic

    def switch(self, on: bool) -> None:
        """Subscribes or ends that; does nothing where it is so already."""
        if on and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self._topic, self._kind, self._waiting.append, queue_size=self._keep, buff_size=_BUFFER_BYTES
            )
        elif not on and self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
            self._waiting.clear()

    def take(self) -> list[Any]:
        """Returns the messages that came since the last call, the oldest first."""
        taken = []
        while self._waiting:
            taken.append(self._waiting.popleft())
        return taken
