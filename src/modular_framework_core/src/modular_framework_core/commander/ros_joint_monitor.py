# SPDX-License-Identifier: BSD-3-Clause
"""The latest positions and velocities of the robot's joints."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable

import rospy
from sensor_msgs.msg import JointState

from modular_framework_ros.calls import wait_until
from modular_framework_ros.simulated_time import SimulatedTime

REST_SPEED = 0.02  # [rad/s or m/s]
REST_TIMEOUT_S = 1.0
REST_PERIOD_S = 0.02  # of simulated time, where that is held


class JointMonitor:
    """Keeps the latest joint positions and velocities; safe to use from several threads.

    Subscribers: ``joint_states`` (sensor_msgs/JointState).

    Args:
        queue_size: Length of the subscriber's queue. Above 1 where one node publishes its joints in several messages
            and none may be missed; 1 where a queued, old message must not count as new.
    """

    def __init__(self, queue_size: int = 10) -> None:
        self._queue_size = queue_size
        self._lock = threading.Lock()
        self._positions: dict[str, float] = {}
        self._velocities: dict[str, float] = {}
        self._received: dict[str, float] = {}
        self._latest: rospy.Time | None = None
        self._time = SimulatedTime()
        self._subscriber: rospy.Subscriber | None = None

    def connect(self) -> None:
        """Subscribes to the joint states."""
        self._subscriber = rospy.Subscriber(
            "joint_states", JointState, self._on_joint_states, queue_size=self._queue_size
        )

    def catch_up(self) -> None:
        """Where simulated time is held: waits until the joints are known as they are at the time that it stands at.

        Raises:
            CallError: they are not received.
        """
        self._time.catch_up(lambda: self._latest)

    def positions(self, names: Iterable[str]) -> dict[str, float]:
        """Returns the positions of joints [rad or m]; joints that have not been received are left out."""
        with self._lock:
            return {name: self._positions[name] for name in names if name in self._positions}

    def wait_for_rest(self, names: Iterable[str], stop_requested: Callable[[], bool]) -> bool:
        """Waits until a new state of every joint was received and all are slow; False when that takes too long.

        A controller ends a goal some milliseconds before the joints' last positions arrive, and a finger may still
        move within the goal's tolerance. A joint without a velocity counts as resting.

        Args:
            names: Joints.
            stop_requested: Evaluated during the wait; True ends it.
        """
        joints, begun_s = tuple(names), time.monotonic()
        if self._time.enabled:
            return self._rests_in_held_time(joints, stop_requested)
        wait_until(lambda: stop_requested() or self._at_rest_since(joints, begun_s), REST_TIMEOUT_S)
        return self._at_rest_since(joints, begun_s)

    def _rests_in_held_time(self, joints: tuple[str, ...], stop_requested: Callable[[], bool]) -> bool:
        """As `wait_for_rest`, asking for simulated time to pass, so that the same states are looked at every time."""

        def rests() -> bool:
            self.catch_up()
            return stop_requested() or self._at_rest_since(joints, 0.0)

        return self._time.wait_until(rests, REST_TIMEOUT_S, REST_PERIOD_S)

    def message(self, names: Iterable[str]) -> JointState:
        """Makes a joint state message of some joints, as they are now."""
        self.catch_up()
        positions = self.positions(names)
        state = JointState(name=list(positions), position=list(positions.values()))
        state.header.stamp = rospy.Time.now()
        return state

    def _at_rest_since(self, names: Iterable[str], begun_s: float) -> bool:
        with self._lock:
            return all(
                self._received.get(name, 0.0) > begun_s and abs(self._velocities.get(name, 0.0)) < REST_SPEED
                for name in names
            )

    def _on_joint_states(self, message: JointState) -> None:
        with self._lock:
            self._positions.update(zip(message.name, message.position, strict=False))
            self._velocities.update(zip(message.name, message.velocity, strict=False))
            self._received.update(dict.fromkeys(message.name, time.monotonic()))
            self._latest = message.header.stamp
