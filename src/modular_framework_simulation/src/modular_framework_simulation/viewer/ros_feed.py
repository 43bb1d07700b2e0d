# SPDX-License-Identifier: BSD-3-Clause
"""Subscribes to topics only while a browser is connected."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import rospy
import tf2_ros

from modular_framework_simulation.models.poses import Pose, normalised_quaternion

_BUFFER_BYTES = 1 << 24
"""Buffer for a whole image; with a smaller buffer, rospy falls behind."""


class Feed:
    """Queue of unread messages of a topic.

    Args:
        topic: Name of the topic.
        kind: Message type of the topic.
        keep: Maximum number of queued messages; the oldest messages are dropped.
        on_message: Function that gets each message instead of the queue, in the thread of its connection.
    """

    def __init__(
        self, topic: str, kind: Any, keep: int = 1, *, on_message: Callable[[Any], None] | None = None
    ) -> None:
        self._topic, self._kind, self._keep = topic, kind, keep
        self._queue: deque[Any] = deque(maxlen=keep)
        self._on_message = on_message or self._queue.append
        self._subscriber: Any = None

    @property
    def topic(self) -> str:
        """Returns the name of the topic."""
        return self._topic

    def switch(self, on: bool) -> None:
        """Subscribes or unsubscribes; does nothing without a change."""
        if on and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self._topic, self._kind, self._on_message, queue_size=self._keep, buff_size=_BUFFER_BYTES
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


class BasePose:
    """Listens to transforms if the fixed frame is not the robot's root link.

    Args:
        fixed_frame: Name of the frame that is drawn at the origin.
    """

    def __init__(self, fixed_frame: str) -> None:
        self._fixed_frame = fixed_frame
        self._buffer: Any = None
        self._listener: Any = None
        self._last = Pose()

    def find(self, root: str) -> Pose:
        """Returns the pose of a root link in the fixed frame; without a transform, the last known pose."""
        if root == self._fixed_frame:
            return Pose()
        if self._listener is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._listener = tf2_ros.TransformListener(self._buffer)
        try:
            transform = self._buffer.lookup_transform(self._fixed_frame, root, rospy.Time(0)).transform
        except tf2_ros.TransformException:
            return self._last
        p, q = transform.translation, transform.rotation
        self._last = Pose((p.x, p.y, p.z), normalised_quaternion((q.x, q.y, q.z, q.w)))
        return self._last

    def close(self) -> None:
        """Stops listening; may be called twice."""
        if self._listener is not None:
            self._listener.unregister()
            self._listener = self._buffer = None
