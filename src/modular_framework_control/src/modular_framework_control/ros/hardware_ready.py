# SPDX-License-Identifier: BSD-3-Clause
"""Publishes, and waits for, the readiness of hardware for controllers: the topics `topic_to_wait_for`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import rospy
from std_msgs.msg import Bool

from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle
from modular_framework_ros.parameter_declarations import parameters_below

WAIT_PERIOD_S = 0.05
USUAL_START_S = 10.0
"""A fault that a start takes longer than this to clear is logged [s]."""


class HardwareNotReadyError(Exception):
    """Hardware did not announce in time that it is ready; names the hardware and its topic."""


@dataclass(frozen=True, slots=True)
class ReadyTopics:
    """Which topics announce which hardware as ready.

    Attributes:
        awaited: topic by hardware, of hardware that announces itself.
        announced: topics on which the node announces hardware that does not announce itself.
    """

    awaited: Mapping[str, str]
    announced: frozenset[str]


def ready_topics_of(robot_hw: RobotHW, robot_hw_nh: NodeHandle) -> ReadyTopics:
    """The topics of initialised hardware: of each part when it is a combination, and its own.

    Raises:
        ParameterError: `topic_to_wait_for` is not the name of a topic.
    """
    listed = {robot_hw_nh.namespace: (robot_hw, robot_hw_nh)}
    if isinstance(robot_hw, CombinedRobotHW):
        listed |= {part.name: (part.hardware, robot_hw_nh.child(part.name)) for part in robot_hw.parts}
    awaited: dict[str, str] = {}
    announced: set[str] = set()
    for name, (hardware, handle) in listed.items():
        parameters = parameters_below("modular_framework_control", "hardware", handle, handle)
        topic = parameters.value("~topic_to_wait_for")
        if topic and hardware.announces_ready:
            awaited[name] = rospy.resolve_name(topic)
        elif topic:
            announced.add(rospy.resolve_name(topic))
    return ReadyTopics(awaited, frozenset(announced - set(awaited.values())))


class HardwareReadiness:
    """Waits for hardware that announces itself, and announces the rest.

    Args:
        topics: of the hardware that is awaited and of the hardware to announce; all are std_msgs/Bool, latched.
        robot_hw: the hardware.
    """

    def __init__(self, topics: ReadyTopics, robot_hw: RobotHW) -> None:
        self._topics, self._robot_hw = topics, robot_hw
        self._ready = {name: threading.Event() for name in topics.awaited}
        self._subscribers: list[rospy.Subscriber] = []
        self._publishers: list[rospy.Publisher] = []

    def connect(self) -> None:
        """Subscribes the topics of awaited hardware."""
        for name, topic in self._topics.awaited.items():
            self._subscribers.append(rospy.Subscriber(topic, Bool, self._on_ready, self._ready[name], queue_size=1))

    @staticmethod
    def _on_ready(message: Bool, event: threading.Event) -> None:
        if message.data:
            event.set()

    def wait(self, timeout_s: float, ended: threading.Event, fault: Callable[[], str]) -> None:
        """Waits until all hardware is ready and every awaited one has published True, or the node is shut down.

        Args:
            timeout_s: how long to wait for all of them together [s of real time].
            ended: set to end the wait.
            fault: returns the fault of the hardware; logged when it lasts.

        Raises:
            HardwareNotReadyError: not all have; names each that has not.
        """
        begun_s, logged = time.monotonic(), ""
        while not (self._robot_hw.initialised and all(event.is_set() for event in self._ready.values())):
            time.sleep(WAIT_PERIOD_S)
            if rospy.is_shutdown() or ended.is_set():
                return
            cause, waited_s = fault(), time.monotonic() - begun_s
            if waited_s > timeout_s:
                raise HardwareNotReadyError(
                    f"waited {timeout_s:g} s in vain for {self._missing()}; "
                    f"{cause or 'is the hardware switched on and connected?'} (~ready_timeout gives it longer)"
                )
            if cause != logged and waited_s > USUAL_START_S:
                rospy.logwarn("hardware not ready: %s", cause or "no fault any more")
                logged = cause

    def _missing(self) -> str:
        topics = [
            f"topic {self._topics.awaited[name]} of hardware '{name}'"
            for name, event in self._ready.items()
            if not event.is_set()
        ]
        return f"True on {', '.join(topics)}" if topics else "the hardware"

    def announce(self) -> None:
        """Publishes True, latched, for the hardware that does not do so itself."""
        for topic in sorted(self._topics.announced):
            self._publishers.append(rospy.Publisher(topic, Bool, queue_size=1, latch=True))
            self._publishers[-1].publish(True)

    def close(self) -> None:
        """Closes all topics; may be called twice."""
        while self._subscribers:
            self._subscribers.pop().unregister()
        while self._publishers:
            self._publishers.pop().unregister()
