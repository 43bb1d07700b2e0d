# SPDX-License-Identifier: BSD-3-Clause
"""Receives camera messages on demand; the messages are not older than the call."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import rospy

from modular_framework_core.grasp_generation.wait_limit import WaitLimit
from modular_framework_ros.calls import wait_until
from modular_framework_ros.simulated_time import SimulatedTime

MAX_REAL_WAIT_S = 300.0
"""Maximum wait for messages [s of real time], for a paused world or time held during rendering."""
BUFFER_BYTES = 1 << 25


class NoMessageError(RuntimeError):
    """No message of a topic arrived in time.

    Attributes:
        topic: Full name of the topic.
        publishers: Number of publishers of the topic.
    """

    def __init__(self, topic: str, publishers: int) -> None:
        super().__init__(f"no message arrived on topic '{topic}' from {publishers} publisher(s)")
        self.topic = topic
        self.publishers = publishers


class FreshMessages:
    """Subscribes to topics only while waiting, since a camera renders only for subscribers."""

    def __init__(self) -> None:
        """Creates the receiver without any subscription."""
        self._time = SimulatedTime()

    def take(self, kinds: Mapping[str, type], timeout_s: float) -> dict[str, Any]:
        """Waits for a message of each topic; all messages have the same stamp, which is not older than this call.

        If time is held, only messages with exactly that stamp count; a later stamp is from before a world reset.

        Args:
            kinds: Message type of each topic, with a header.
            timeout_s: Maximum wait [s of the ROS clock; s of real time for a topic without a publisher].

        Raises:
            NoMessageError: No message of a topic arrived in time.
        """
        held = self._time.now()
        start_time = held or rospy.Time.now()
        received: dict[str, dict[rospy.Time, Any]] = {topic: {} for topic in kinds}
        lock = threading.Lock()

        def keep(topic: str, message: Any) -> None:
            stamp = message.header.stamp
            if stamp.is_zero() or stamp == start_time or (held is None and stamp > start_time):
                with lock:
                    received[topic].setdefault(stamp, message)

        def common_stamps() -> set[rospy.Time]:
            with lock:
                return set.intersection(*(set(messages) for messages in received.values()))

        subscribers = {
            topic: rospy.Subscriber(topic, kind, partial(keep, topic), queue_size=1, buff_size=BUFFER_BYTES)
            for topic, kind in kinds.items()
        }
        limit, since_s = WaitLimit(), time.monotonic()

        def is_over() -> bool:
            published = all(subscriber.get_num_connections() for subscriber in subscribers.values())
            real_s = MAX_REAL_WAIT_S if published else timeout_s
            return limit.is_exceeded(rospy.get_time(), timeout_s) or time.monotonic() - since_s > real_s

        try:
            wait_until(lambda: bool(common_stamps()) or is_over(), MAX_REAL_WAIT_S)
            if not (stamps := common_stamps()):
                missing = min(subscribers, key=lambda topic: len(received[topic]))
                subscriber = subscribers[missing]
                raise NoMessageError(subscriber.resolved_name, subscriber.get_num_connections())
        finally:
            for subscriber in subscribers.values():
                subscriber.unregister()
        return {topic: messages[min(stamps)] for topic, messages in received.items()}
