# SPDX-License-Identifier: BSD-3-Clause
"""Holds simulated time while a node computes, and advances it while the node waits.

With the parameter ``/wait_for_planning``, nodes can hold the time of the simulation. Held time advances only while a
controller executes a goal, or on request by ``SimulatedTime.sleep``. Without the parameter, and on a real robot, time
is never held, and waits use the ROS clock.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rospy
from simulation_time_msgs.srv import AdvanceTime, AdvanceTimeRequest, AdvanceTimeResponse, HoldTime, HoldTimeRequest

from modular_framework_ros.calls import CallError, request_service, wait_until
from modular_framework_ros.declared_parameters import DeclaredParameters

WAIT_PARAMETER = "/wait_for_planning"
HOLD_SERVICE = "/gazebo/hold_time"
ADVANCE_SERVICE = "/gazebo/advance_time"
LEASE_S = 10.0
RENEWALS = 5
"""Renewals of a hold within its lease."""
ANSWER_TIMEOUT_S = 40.0
MIN_REAL_TIME_FACTOR = 0.02
SAME_TIME_S = 1.0e-6
CLOCK_TIMEOUT_S, CLOCK_JUMP_S = 1.0, 1.0


class SimulatedTime:
    """A thread-safe client for the simulation's time.

    - Parameter: ``/wait_for_planning`` (bool, false), read at the first use.
    - Services called: ``/gazebo/hold_time`` (simulation_time_msgs/HoldTime), ``/gazebo/advance_time``
      (simulation_time_msgs/AdvanceTime).
    """

    def __init__(self) -> None:
        self._enabled: bool | None = None

    @property
    def enabled(self) -> bool:
        """Whether nodes can hold the time of the simulation."""
        if self._enabled is None:
            self._enabled = bool(DeclaredParameters("modular_framework_ros", "launch").value(WAIT_PARAMETER))
        return self._enabled

    @contextmanager
    def held(self, owner: str, during_motions: bool = False) -> Iterator[None]:
        """Holds simulated time inside the context; if the process dies, the hold ends after LEASE_S.

        Args:
            owner: Owner of the hold, made unique by the name of the node.
            during_motions: Whether time is also held while controllers execute goals.

        Raises:
            CallError: The simulation does not hold its time.
        """
        if not self.enabled:
            yield
            return
        name = f"{rospy.get_name()} {owner} {threading.get_ident()}"
        request = HoldTimeRequest(owner=name, lease_s=LEASE_S, during_motions=during_motions)
        _hold(request)
        over = threading.Event()
        renewing = threading.Thread(target=_renew, args=(request, over), daemon=True, name=f"hold of {owner}")
        renewing.start()
        try:
            yield
        finally:
            over.set()
            renewing.join()
            if not rospy.is_shutdown():
                _release(name)

    def sleep(self, duration_s: float) -> None:
        """Waits until simulated time has advanced by a duration [s], which advances held time.

        If time is held, the clock of this node has the new time on return.

        Raises:
            CallError: The simulation does not advance its time.
        """
        if self.enabled:
            self._advance(duration_s)
        else:
            rospy.sleep(duration_s)

    def catch_up(self, latest: Callable[[], rospy.Time | None] = lambda: None, timeout_s: float = 3.0) -> None:
        """Waits until clock, planning scene and the caller's messages are up to date; returns at once if disabled.

        Args:
            latest: Function that returns the stamp of the latest message received by the caller; None before the first
                message or without a subscription.
            timeout_s: Maximum wait for that message [s of real time].

        Raises:
            CallError: The simulation does not respond, or no message arrived.
        """
        if not self.enabled:
            return
        response = self._advance(0.0)
        now_s = response.stamp.to_sec()

        def is_of_now() -> bool:
            stamp = latest()
            late_s = None if stamp is None else stamp.to_sec() - now_s
            return late_s is not None and (abs(late_s) < SAME_TIME_S if response.held else late_s > -SAME_TIME_S)

        if latest() is not None and not wait_until(is_of_now, timeout_s, 0.002):
            raise CallError(
                f"no message of the simulated time {now_s:.3f} s came within {timeout_s:g} s; the latest is of "
                f"{latest()}; is its publisher running?"
            )

    def now(self) -> rospy.Time | None:
        """Returns the simulation's time; None if time is not held, so that only the ROS clock is available.

        Raises:
            CallError: The simulation does not respond.
        """
        response = self._advance(0.0) if self.enabled else None
        return response.stamp if response is not None and response.held else None

    def wait_until(self, condition: Callable[[], bool], timeout_s: float, period_s: float) -> bool:
        """Waits for a condition while simulated time advances; returns whether it was met in time.

        Args:
            condition: Function polled after each period, while time is held.
            timeout_s: Maximum wait [s of simulated time].
            period_s: Time between two checks [s of simulated time].
        """
        passed_s = 0.0
        while not condition():
            if passed_s >= timeout_s or rospy.is_shutdown():
                return False
            self.sleep(period_s)
            passed_s += period_s
        return True

    @staticmethod
    def _advance(duration_s: float) -> AdvanceTimeResponse:
        request = AdvanceTimeRequest(duration=rospy.Duration.from_sec(duration_s))
        response = request_service(
            ADVANCE_SERVICE, AdvanceTime, request, ANSWER_TIMEOUT_S + duration_s / MIN_REAL_TIME_FACTOR
        )
        if not response.success:
            raise CallError(f"service '{ADVANCE_SERVICE}': {response.message}")
        if response.held and not rospy.rostime.is_wallclock():
            wait_until(lambda: _clock_shows(response.stamp.to_sec()), CLOCK_TIMEOUT_S, 0.001)
        return response


def _clock_shows(time_s: float) -> bool:
    """Returns whether the clock of this node has reached a time of the simulation [s]."""
    late_s = rospy.get_time() - time_s
    return -SAME_TIME_S < late_s < CLOCK_JUMP_S  # a larger value was read before a reset of the world


def _hold(request: HoldTimeRequest) -> None:
    response = request_service(HOLD_SERVICE, HoldTime, request, ANSWER_TIMEOUT_S)
    if not response.success:
        raise CallError(f"service '{HOLD_SERVICE}': {response.message}")


def _release(owner: str) -> None:
    try:
        _hold(HoldTimeRequest(owner=owner, lease_s=0.0))
    except CallError as error:  # the lease ends the hold once the simulation responds again
        rospy.logwarn("the hold of simulated time is not released: %s", error)


def _renew(request: HoldTimeRequest, over: threading.Event) -> None:
    while not over.wait(LEASE_S / RENEWALS):
        try:
            _hold(request)
        except CallError as error:
            rospy.logwarn("the hold of simulated time is not renewed: %s", error)
            return
