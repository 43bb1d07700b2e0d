# SPDX-License-Identifier: BSD-3-Clause
"""Calls services and actions of other nodes; every wait has a timeout and ends when the task is stopped.

All limits are wall time: a simulation that is paused or has died stops the clock of ROS, and every wait on it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

from modular_framework_ros.action_client import is_connected
from modular_framework_ros.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.start_up import WaitReport, wait_for_start
from modular_framework_ros.stop_requests import stop_requested

POLL_PERIOD_S = 0.01
STOP_PERIOD_S = 0.05

WATCHED_AFTER_S = 2.0
"""Wait after which a call looks for frozen nodes [s]."""

CANCEL_WAIT_S = 0.5
"""Longest wait for the result of a cancelled goal [s]; a task has to end within a second of a request to stop."""


class CallError(RuntimeError):
    """A service or an action did not answer; the text names it and the time waited, or that the task was stopped."""


def wait_until(condition: Callable[[], bool], timeout_s: float, period_s: float = POLL_PERIOD_S) -> bool:
    """Waits for a condition [wall time]; False when it did not hold in time, or ROS shuts down."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if rospy.is_shutdown() or time.monotonic() >= deadline:
            return False
        time.sleep(period_s)
    return True


def wait_for_service(proxy: rospy.ServiceProxy, timeout_s: float) -> None:
    """Waits for a service to be advertised.

    Raises:
        CallError: It was not advertised in time, or what needs it was asked to stop.
    """
    end = time.monotonic() + timeout_s
    report = WaitReport(f"service '{proxy.resolved_name}'", timeout_s)
    while True:
        report.remind()
        if stop_requested():
            raise _given_up(f"service '{proxy.resolved_name}'")
        try:
            rospy.wait_for_service(proxy.resolved_name, max(0.05, min(0.2, end - time.monotonic())))
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


def call_service(proxy: rospy.ServiceProxy, request: Any, timeout_s: float) -> Any:
    """Calls a service.

    Args:
        proxy: The service.
        request: Its request.
        timeout_s: Longest wait for the answer [s].

    Returns:
        The answer.

    Raises:
        CallError: The service is absent, refused the call, or did not answer in time, or what needs the answer was
            asked to stop.
    """
    answers: list[Any] = []
    errors: list[Exception] = []
    done = threading.Event()

    def call() -> None:
        try:
            answers.append(proxy(request))
        except (rospy.ServiceException, rospy.ROSException, OSError) as error:
            errors.append(error)
        finally:
            done.set()

    begun_s = time.monotonic()
    deadline = begun_s + timeout_s
    threading.Thread(target=call, daemon=True, name=f"call {proxy.resolved_name}").start()
    while not done.wait(max(0.0, min(STOP_PERIOD_S, deadline - time.monotonic()))) and time.monotonic() < deadline:
        if stop_requested():
            raise _given_up(f"service '{proxy.resolved_name}'")
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
        kind: Its type.
        request: Its request.
        timeout_s: Longest wait for the service, and again for its answer [s].

    Returns:
        The answer.

    Raises:
        CallError: As of ``wait_for_service`` and ``call_service``.
    """
    proxy = rospy.ServiceProxy(name, kind)
    wait_for_service(proxy, timeout_s)
    return call_service(proxy, request, timeout_s)


def _given_up(what: str) -> CallError:
    return CallError(f"{what} was not waited for any longer: the task was asked to stop")


def wait_for_action(client: actionlib.SimpleActionClient, name: str, timeout_s: float) -> None:
    """Waits until an action server listens to a client.

    Raises:
        CallError: No server was there in time, or what needs it was asked to stop.
    """
    what = f"action server '{rospy.resolve_name(name)}'"
    there = wait_for_start(lambda: is_connected(client) or stop_requested(), what, timeout_s)
    if stop_requested():
        raise _given_up(what)
    if not there:
        raise CallError(f"{what} was not there within {timeout_s:.1f} s; start the node that offers it")


def wait_for_result(
    client: actionlib.SimpleActionClient, timeout_s: float, stop_requested: Callable[[], bool] = stop_requested
) -> int:
    """Waits for the end of a goal; cancels it when asked to stop or out of time.

    Args:
        client: Client whose goal was sent.
        timeout_s: Longest wait [s].
        stop_requested: Asked all the time; True cancels the goal.

    Returns:
        The final goal status, PREEMPTED after a stop, LOST out of time or when a node is frozen.
    """
    stopped, watched_from_s = False, time.monotonic() + WATCHED_AFTER_S

    def ended() -> bool:
        # The status of the goal is final some time before its result is here; DONE means that both are. The goal
        # handle knows, while the client itself misses an end that comes before send_goal() returns.
        return bool(client.gh is not None and client.gh.get_comm_state() == CommState.DONE)

    def finished() -> bool:
        nonlocal stopped
        stopped = stopped or stop_requested()
        return stopped or ended() or (time.monotonic() > watched_from_s and bool(frozen_nodes()))

    if wait_until(finished, timeout_s) and not stopped and ended():
        return int(client.get_state())
    client.cancel_goal()
    wait_until(ended, CANCEL_WAIT_S)
    return int(GoalStatus.PREEMPTED if stopped else GoalStatus.LOST)
