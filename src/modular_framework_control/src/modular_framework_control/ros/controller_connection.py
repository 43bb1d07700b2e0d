# SPDX-License-Identifier: BSD-3-Clause
"""Connects one controller to ROS: opens its topics, which are closed together, and publishes for the control loop."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rospy

from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.ros.outbox import Outbox
from modular_framework_ros.node_handle import join_names

QUEUE_SIZE = 50
"""Length of the publishers' queues: a simulation that runs faster than real time sends messages in bursts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerConnection:
    """The ROS connection of one controller.

    Attributes:
        namespace: Absolute namespace of the robot.
        name: Absolute name of the controller.
        outbox: Thread that publishes for the control loop.
        loop_time: Offset between the stamps of messages and the time of the control loop.
        opened: Open topics, actions and services; closing the stack closes the connection.
    """

    namespace: str
    name: str
    outbox: Outbox
    loop_time: LoopTime
    opened: contextlib.ExitStack

    @property
    def ahead_s(self) -> float:
        """Returns the offset of a message's stamp from the time of the control loop [s]."""
        return self.loop_time.ahead_s

    def advertise(self, topic: str, kind: Any, queue_size: int = QUEUE_SIZE) -> Callable[[Callable[[], Any]], None]:
        """Opens a topic and returns its publish function, which never waits and takes a function that makes a message.

        Args:
            topic: Name below the controller's name, or an absolute name.
            kind: Type of the messages.
            queue_size: Length of the publisher's queue.
        """
        publisher = rospy.Publisher(self.topic(topic), kind, queue_size=queue_size)
        self.opened.callback(publisher.unregister)
        return lambda make_message: self.outbox.publish(publisher, make_message)

    def subscribe(self, topic: str, kind: Any, handle: Callable[[Any], None]) -> rospy.Subscriber:
        """Subscribes to a topic; only the latest message is kept.

        Args:
            topic: Name below the controller's name.
            kind: Type of the messages.
            handle: Function that is called with each message.
        """
        subscriber = rospy.Subscriber(self.topic(topic), kind, handle, queue_size=1)
        self.opened.callback(subscriber.unregister)
        return subscriber

    def topic(self, topic: str) -> str:
        """Returns the absolute name of a topic below the controller's name; an absolute name stays."""
        return topic if topic.startswith("/") else join_names(self.name, topic)
