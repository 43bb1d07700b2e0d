# SPDX-License-Identifier: BSD-3-Clause
"""Calls services and actions of other nodes; every wait has a timeout and ends when the task is stopped.

Timeouts are in real time, since a paused or crashed simulation stops the ROS clock. The wait for the end of a goal
counts the slower of real time and the ROS clock, since a simulation on a loaded machine moves slowly.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from modular_framework_ros.action_client import is_connected
from modular_framework_ros.connections.ros_frozen_nodes import WATCHED_AFTER_S, frozen_nodes
from modular_framework_ros.start_up import WaitReport, wait_for_start
from modular_framework_ros.stop_requests import stop_requested

POLL_PERIOD_S = 0.01
STOP_PERIOD_S = 0.05
PROBE_TIME_S = 0.2
"""Maximum duration of one check for a service [s], which bounds the reaction to a stop request."""

CANCEL_WAIT_S = 0.5
"""Maximum wait for the result of a cancelled goal [s]; a task must end within a second of a stop request."""

STOPPED_CLOCK_S = 1.0
"""Real time without a change of the ROS clock after which the clock counts as stopped [s]."""


class CallError(RuntimeError):
    """A service or an action did not respond; the message gives its name and the time waited, or the stop request."""


class MotionTimeout:
    """Counts the slower of real time and the ROS clock, from its creation.

    If the simulation is slower than real time, a motion takes more real time. If the simulation is faster, a node has
    less real time to respond within the same simulated time. While the ROS clock stands still, because the world is
    paused or time is held, real time counts alone. A reset of the clock to an earlier time counts nothing.

    Args:
        limit_s: Timeout [s].
    """

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        self._passed_s = 0.0
        self._real_s, self._clock_s = time.monotonic(), _clock_s()

    def is_exceeded(self) -> bool:
        """Returns whether the timeout has elapsed."""
        real_s, clock_s = time.monotonic(), _clock_s()
        real_step_s = real_s - self._real_s
        if clock_s is None:
            step_s = real_step_s
        elif clock_s != self._clock_s:
            step_s = min(real_step_s, max(0.0, clock_s - (self._clock_s or 0.0)))
        elif real_step_s > STOPPED_CLOCK_S:
            step_s = real_step_s
        else:
            return self._passed_s >= self.limit_s
        self._passed_s += step_s
        self._real_s, self._clock_s = real_s, clock_s
        return self._passed_s >= self.limit_s


def _clock_s() -> float | None:
    """Returns the time of the simulation's clock [s]; None without one."""
    if rospy.rostime.is_wallclock() or not rospy.rostime.is_rostime_initialized():
        return None
    return float(rospy.get_time())


def wait_until(condition: Callable[[], bool], timeout_s: float, period_s: float = POLL_PERIOD_S) -> bool:
    """Waits for a condition; returns False if it is not met in time or ROS shuts down.

    Args:
        condition: Function that returns whether the condition is met.
        timeout_s: Maximum wait [s of real time].
        period_s: Time between two checks [s of real time].
    """
    deadline = time.monotonic() + timeout_s
    while not condition():
        if rospy.is_shutdown() or time.monotonic() >= deadline:
            return False
        time.sleep(period_s)
    return True


def is_advertised(service: str) -> bool:
    """Returns whether a service is advertised, within ``PROBE_TIME_S``."""
    try:
        rospy.wait_for_service(service, PROBE_TIME_S)
    except rospy.ROSException:
        return False
    return True


def wait_for_service(proxy: rospy.ServiceProxy, timeout_s: float) -> None:
    """Waits for a service to be advertised.

    Raises:
        CallError: The service was not advertised in time, or the task was stopped.
    """
    end = time.monotonic() + timeout_s
    report = WaitReport(f"service '{proxy.resolved_name}'", timeout_s)
    while True:
        report.remind()
        if stop_requested():
            raise _stop_error(f"service '{proxy.resolved_name}'")
        try:
            rospy.wait_for_service(proxy.resolved_name, max(0.05, min(PROBE_TIME_S, end - time.monotonic())))
            return
        except rospy.ROSException as error:
            if rospy.is_shutdown():
                raise CallError(
                    f"service '{proxy.resolved_name}' was not advertised before this node was shut down"
                ) from error
            if time.monotonic() >= end:
                raise CallError(
                    f"service '{proxy.resolved_name}' was not advertised within {timeout_s:.1f} s; "
                    "start the node that offers it"
                ) from error


def call_service(
    proxy: rospy.ServiceProxy, request: Any, timeout_s: float, stop_requested: Callable[[], bool] = stop_requested
) -> Any:
    """Calls a service.

    Args:
        proxy: Proxy of the service.
        request: Request message.
        timeout_s: Maximum wait for the response [s of real time]; may be infinite.
        stop_requested: Function polled during the wait; the wait ends when it returns True.

    Returns:
        The response message.

    Raises:
        CallError: The service is absent, rejected the call or did not respond in time, the request has a value of the
            wrong type, or the task was stopped.
    """
    answers: list[Any] = []
    errors: list[Exception] = []
    done = threading.Event()

    def call() -> None:
        try:
            answers.append(proxy(request))
        except Exception as error:  # the caller reports any error
            errors.append(error)
        finally:
            done.set()

    begun_s = time.monotonic()
    deadline = begun_s + timeout_s
    threading.Thread(target=call, daemon=True, name=f"call {proxy.resolved_name}").start()
    while not done.wait(max(0.0, min(STOP_PERIOD_S, deadline - time.monotonic()))) and time.monotonic() < deadline:
        if stop_requested():
            raise _stop_error(f"service '{proxy.resolved_name}'")
        if time.monotonic() > begun_s + WATCHED_AFTER_S and (frozen := frozen_nodes()):
            raise CallError(f"service '{proxy.resolved_name}' does not answer: {frozen}")
    if answers:
        return answers[0]
    if errors:
        raise CallError(f"service '{proxy.resolved_name}' failed: {errors[0]}")
    raise CallError(f"service '{proxy.resolved_name}' did not answer within {timeout_s:.1f} s")


def request_service(name: str, kind: Any, request: Any, timeout_s: float) -> Any:
    """Waits for a service and calls it once.

    Args:
        name: Name of the service.
        kind: Type of the service.
        request: Request message.
        timeout_s: Maximum wait for the service, and then for its response [s of real time].

    Returns:
        The response message.

    Raises:
        CallError: As in `wait_for_service` and `call_service`.
    """
    proxy = rospy.ServiceProxy(name, kind)
    wait_for_service(proxy, timeout_s)
    return call_service(proxy, request, timeout_s)


def _stop_error(target: str) -> CallError:
    return CallError(f"the wait for {target} ended because the task was asked to stop")


def wait_for_action(client: actionlib.SimpleActionClient, name: str, timeout_s: float) -> None:
    """Waits until an action server is connected to a client.

    Args:
        client: Client of the action.
        name: Name of the action, for messages.
        timeout_s: Maximum wait [s of real time].

    Raises:
        CallError: No server was connected in time, or the task was stopped.
    """
    label = f"action server '{rospy.resolve_name(name)}'"
    there = wait_for_start(lambda: is_connected(client) or stop_requested(), label, timeout_s)
    if stop_requested():
        raise _stop_error(label)
    if not there:
        raise CallError(f"{label} was not available within {timeout_s:.1f} s; start the node that offers it")


def wait_for_result(
    client: actionlib.SimpleActionClient, timeout_s: float, stop_requested: Callable[[], bool] = stop_requested
) -> int:
    """Waits for the end of a goal; cancels the goal on a stop request or a timeout.

    Args:
        client: Client that has sent the goal.
        timeout_s: Maximum wait [s of the slower of real time and the ROS clock].
        stop_requested: Function polled during the wait; the goal is cancelled when it returns True.

    Returns:
        The final goal status: PREEMPTED after a stop request, LOST after a timeout or if a node is frozen.
    """
    timeout = MotionTimeout(timeout_s)
    stopped, watched_from_s = False, time.monotonic() + WATCHED_AFTER_S

    def has_ended() -> bool:
        # The goal status is final before the result has arrived; DONE means both. The goal handle has this state,
        # while the client misses an end that comes before send_goal() returns.
        return bool(client.gh is not None and client.gh.get_comm_state() == CommState.DONE)

    def is_finished() -> bool:
        nonlocal stopped
        stopped = stopped or stop_requested()
        return stopped or has_ended() or (time.monotonic() > watched_from_s and bool(frozen_nodes()))

    if wait_until(lambda: is_finished() or timeout.is_exceeded(), math.inf) and not stopped and has_ended():
        return int(client.get_state())
    client.cancel_goal()
    wait_until(has_ended, CANCEL_WAIT_S)
    return int(GoalStatus.PREEMPTED if stopped else GoalStatus.LOST)
