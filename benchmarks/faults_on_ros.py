# SPDX-License-Identifier: BSD-3-Clause
"""The interfaces on which a ROS client learns of a fault of hardware that node `robot_hw` drives."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from modular_framework_testing.ros_session import RosSession

PATIENCE_S = 30.0
DIAGNOSTICS = "/diagnostics"
RESULT = "result of the goal"


class StuckError(Exception):
    """A wait timed out; the text has its length and the fault on /diagnostics."""


@dataclass(frozen=True, slots=True)
class Naming:
    """Text of one ROS interface.

    Attributes:
        time_s: Arrival on the monotonic clock [s].
        channel: ROS interface.
        text: Text.
    """

    time_s: float
    channel: str
    text: str


@contextlib.contextmanager
def ros_client() -> Iterator[RosSession]:
    """Starts a ROS master and makes this process a node; ends both."""
    session = RosSession()
    os.environ.update({name: session.env[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR")})
    import rospy

    try:
        session.start_master()
        rospy.init_node("benchmark", disable_signals=True)
        yield session
    finally:
        rospy.signal_shutdown("done")
        session.stop()


class NamedFaults:
    """Texts about one node `robot_hw`: faults on /diagnostics, and texts that a client adds, such as results of goals.

    Args:
        node: Name of the node without the first slash.
    """

    def __init__(self, node: str) -> None:
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        self._node = node
        self._namings: list[Naming] = []
        self.fault = ""
        self._subscriber = rospy.Subscriber(DIAGNOSTICS, DiagnosticArray, self._on_diagnostics)

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name.partition(":")[0] == self._node:
                self.fault = next(value.value for value in status.values if value.key == "fault")
                # the message has the warnings too
                self.add(DIAGNOSTICS, self.fault or status.message)

    def add(self, channel: str, text: str) -> None:
        """Adds a text that arrived now."""
        self._namings.append(Naming(time.monotonic(), channel, text))

    def first(self, reason: str, since_s: float) -> Naming | None:
        """Returns the first text with `reason` since a time on the monotonic clock [s], or None."""
        return next((one for one in list(self._namings) if one.time_s >= since_s and reason in one.text), None)

    def last(self, channel: str) -> Naming | None:
        """Returns the last text of a ROS interface, or None."""
        return next((one for one in reversed(list(self._namings)) if one.channel == channel), None)

    def until(self, condition: Callable[[], Any], timeout_s: float = PATIENCE_S) -> float:
        """Waits for a condition and returns the duration [s].

        Raises:
            StuckError: The condition does not hold within the timeout.
        """
        begun_s = time.monotonic()
        while not condition():
            if time.monotonic() - begun_s > timeout_s:
                raise StuckError(f"waited {timeout_s:g} s in vain; {DIAGNOSTICS} has: {self.fault or 'no fault'}")
            time.sleep(0.002)
        return time.monotonic() - begun_s

    def close(self) -> None:
        """Ends the subscription."""
        self._subscriber.unregister()


class Goal:
    """A goal of an action whose status text and result a client reads.

    Args:
        client: Connected action client.
        message: Goal.
        faults: Receives the text of the result.
    """

    def __init__(self, client: Any, message: Any, faults: NamedFaults) -> None:
        self._client, self._faults = client, faults
        self._ended = threading.Event()
        self.ended_s = float("nan")
        self.status: int | None = None
        self.text = ""
        self.result: Any = None
        client.send_goal(message, done_cb=self._on_done)

    def _on_done(self, status: int, result: Any) -> None:
        self.ended_s = time.monotonic()
        self.status, self.result = status, result
        self.text = self._client.get_goal_status_text()
        self._faults.add(RESULT, self.text)
        self._ended.set()

    @property
    def ended(self) -> bool:
        """Whether the result has arrived."""
        return self._ended.is_set()

    def description(self, named: Naming | None) -> str:
        """Describes the end of the goal: its status, and its text unless the text named the fault."""
        from actionlib_msgs.msg import GoalStatus

        names = {value: name.lower() for name, value in vars(GoalStatus).items() if isinstance(value, int)}
        status = names.get(self.status, "no answer") if self.status is not None else "no answer"
        if named is not None and named.text.removeprefix("hardware fault: ") == self.text.removeprefix(
            "hardware fault: "
        ):
            return f"{status} with this text"
        return f"{status}: {self.text}" if self.text else status


def registered(session: RosSession, node: str, faults: NamedFaults) -> float:
    """Waits until a node has registered at the master; returns that time on the monotonic clock [s]."""
    import rosgraph

    master = rosgraph.Master("/benchmark", master_uri=session.env["ROS_MASTER_URI"])

    def known() -> bool:
        with contextlib.suppress(rosgraph.MasterException):
            return bool(master.lookupNode(f"/{node}"))
        return False

    faults.until(known)
    return time.monotonic()


def start_controllers(namespace: str, names: list[str]) -> None:
    """Loads and starts the controllers of a robot.

    Raises:
        StuckError: The services do not appear, or a controller does not start.
    """
    import rospy
    from controller_manager_msgs.srv import LoadController, SwitchController

    manager = f"/{namespace}/controller_manager"
    try:
        rospy.wait_for_service(f"{manager}/switch_controller", PATIENCE_S)
        for name in names:
            rospy.ServiceProxy(f"{manager}/load_controller", LoadController)(name)
        switched = rospy.ServiceProxy(f"{manager}/switch_controller", SwitchController)(names, [], 2, False, 0.0)
    except (rospy.ROSException, rospy.ServiceException) as error:
        raise StuckError(f"controllers of {namespace}: {error}") from error
    if not switched.ok:
        raise StuckError(f"the controllers {names} of {namespace} did not start; the log of the node has the reason")
