# SPDX-License-Identifier: BSD-3-Clause
"""Announces and awaits hardware that is ready for controllers, on the topics named by `topic_to_wait_for`."""

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
"""Time after the start at which a persistent fault is logged [s]."""


class HardwareNotReadyError(Exception):
    """Raised if hardware is not ready in time; names the hardware and its topic."""


@dataclass(frozen=True, slots=True)
class ReadyTopics:
    """Holds the topics that announce hardware as ready.

    Attributes:
        awaited: Topic by name of the hardware, for hardware whose driver announces itself.
        announced: Topics on which the node announces the other hardware.
    """

    awaited: Mapping[str, str]
    announced: frozenset[str]


def ready_topics_of(robot_hw: RobotHW, robot_hw_nh: NodeHandle) -> ReadyTopics:
    """Returns the topics of initialised hardware, including those of the parts of combined hardware.

    Raises:
        ParameterError: If `topic_to_wait_for` is not a topic name.
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
    """Waits for hardware that announces itself, and announces the other hardware.

    Args:
        topics: Topics to wait for and to announce on; all are latched and carry std_msgs/Bool.
        robot_hw: Hardware of the robot.
    """

    def __init__(self, topics: ReadyTopics, robot_hw: RobotHW) -> None:
        self._topics, self._robot_hw = topics, robot_hw
        self._ready = {name: threading.Event() for name in topics.awaited}
        self._subscribers: list[rospy.Subscriber] = []
        self._publishers: list[rospy.Publisher] = []

    def connect(self) -> None:
        """Subscribes to the topics of the awaited hardware."""
        for name, topic in self._topics.awaited.items():
            self._subscribers.append(rospy.Subscriber(topic, Bool, self._on_ready, self._ready[name], queue_size=1))

    @staticmethod
    def _on_ready(message: Bool, event: threading.Event) -> None:
        if message.data:
            event.set()

    def wait(self, timeout_s: float, ended: threading.Event, fault: Callable[[], str]) -> None:
        """Waits until all hardware is initialised and every awaited topic has published True, or until shutdown.

        Args:
            timeout_s: Maximum wait in real time [s].
            ended: Event that ends the wait.
            fault: Callback that returns the fault of the hardware; a persistent fault is logged.

        Raises:
            HardwareNotReadyError: If the time has passed; names the hardware that is not ready.
        """
        begun_s, logged_fault = time.monotonic(), ""
        while not (self._robot_hw.initialised and all(event.is_set() for event in self._ready.values())):
            time.sleep(WAIT_PERIOD_S)
            if rospy.is_shutdown() or ended.is_set():
                return
            cause, waited_s = fault(), time.monotonic() - begun_s
            if waited_s > timeout_s:
                raise HardwareNotReadyError(
                    f"waited {timeout_s:g} s in vain for {self._missing_readiness()}; "
                    f"{cause or 'is the hardware switched on and connected?'} (~ready_timeout extends the wait)"
                )
            if cause != logged_fault and waited_s > USUAL_START_S:
                rospy.logwarn("hardware not ready: %s", cause or "the fault has ended")
                logged_fault = cause

    def _missing_readiness(self) -> str:
        topics = [
            f"topic {self._topics.awaited[name]} of hardware '{name}'"
            for name, event in self._ready.items()
            if not event.is_set()
        ]
        return f"True on {', '.join(topics)}" if topics else "the hardware"

    def announce(self) -> None:
        """Publishes a latched True for the hardware that does not announce itself."""
        for topic in sorted(self._topics.announced):
            self._publishers.append(rospy.Publisher(topic, Bool, queue_size=1, latch=True))
            self._publishers[-1].publish(True)

    def close(self) -> None:
        """Closes all topics; may be called twice."""
        while self._subscribers:
            self._subscribers.pop().unregister()
        while self._publishers:
            self._publishers.pop().unregister()
