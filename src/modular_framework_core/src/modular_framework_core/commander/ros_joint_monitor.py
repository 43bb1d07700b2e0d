# SPDX-License-Identifier: BSD-3-Clause
"""Monitors the positions and velocities of the robot's joints."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable

import rospy
from sensor_msgs.msg import JointState

from modular_framework_ros.calls import MotionTimeout, wait_until
from modular_framework_ros.simulated_time import SimulatedTime

REST_SPEED = 0.02  # [rad/s or m/s]
REST_TIMEOUT_S = 1.0
REST_PERIOD_S = 0.02  # polling period in held simulated time


class JointMonitor:
    """Thread-safe store of the latest joint positions and velocities.

    Subscribers: ``joint_states`` (sensor_msgs/JointState).

    Args:
        queue_size: Queue length of the subscriber: above 1 if the joints arrive in several messages, 1 if an old queued
            message must not count as new.
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
        """In held simulated time, waits for the joint states of the current time.

        Raises:
            CallError: The joint states do not arrive.
        """
        self._time.catch_up(lambda: self._latest)

    def positions(self, names: Iterable[str]) -> dict[str, float]:
        """Returns the latest positions of joints [rad or m]. Joints without a received position are omitted."""
        with self._lock:
            return {name: self._positions[name] for name in names if name in self._positions}

    def wait_for_rest(self, names: Iterable[str], stop_requested: Callable[[], bool]) -> bool:
        """Waits until new states of all joints arrive and all joints are at rest; returns False on timeout.

        A controller ends a goal some milliseconds before the last joint states arrive, and a finger may still move
        within the goal tolerance. A joint without velocity counts as at rest.

        Args:
            names: Joint names.
            stop_requested: Function polled during the wait; True ends the wait.
        """
        joints, start_s = tuple(names), time.monotonic()
        if self._time.enabled:
            return self._wait_for_rest_in_held_time(joints, stop_requested)
        timeout = MotionTimeout(REST_TIMEOUT_S)
        wait_until(lambda: stop_requested() or self._at_rest_since(joints, start_s) or timeout.is_exceeded(), math.inf)
        return self._at_rest_since(joints, start_s)

    def _wait_for_rest_in_held_time(self, joints: tuple[str, ...], stop_requested: Callable[[], bool]) -> bool:
        """Waits as `wait_for_rest` while stepping simulated time, so that repeated runs check the same states."""

        def is_done() -> bool:
            self.catch_up()
            return stop_requested() or self._at_rest_since(joints, 0.0)

        return self._time.wait_until(is_done, REST_TIMEOUT_S, REST_PERIOD_S)

    def message(self, names: Iterable[str]) -> JointState:
        """Returns the current state of joints as a message."""
        self.catch_up()
        positions = self.positions(names)
        state = JointState(name=list(positions), position=list(positions.values()))
        state.header.stamp = rospy.Time.now()
        return state

    def _at_rest_since(self, names: Iterable[str], start_s: float) -> bool:
        with self._lock:
            return all(
                self._received.get(name, 0.0) > start_s and abs(self._velocities.get(name, 0.0)) < REST_SPEED
                for name in names
            )

    def _on_joint_states(self, message: JointState) -> None:
        with self._lock:
            self._positions.update(zip(message.name, message.position, strict=False))
            self._velocities.update(zip(message.name, message.velocity, strict=False))
            self._received.update(dict.fromkeys(message.name, time.monotonic()))
            self._latest = message.header.stamp
