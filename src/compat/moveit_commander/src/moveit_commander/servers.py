# SPDX-License-Identifier: BSD-3-Clause
"""Clients of move_group's services and actions with bounded waits, whose errors name the endpoint."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import rospy
from actionlib import CommState
from rosgraph.names import ns_join

from modular_framework_ros.action_client import SteadyActionClient, is_connected, unconnected_topics
from modular_framework_ros.calls import CallError, call_service, wait_for_service, wait_until
from modular_framework_ros.connections.inbound_connections import accept_connections_at_once
from modular_framework_ros.connections.ros_frozen_nodes import WATCHED_AFTER_S, frozen_nodes
from moveit_commander.exception import ServerError

SERVICE_TIMEOUT_S = 5.0
ACTION_TIMEOUT_S = 5.0
POLL_PERIOD_S = 0.02
LISTENER_TIMEOUT_S = 5.0
SETTLE_S = 0.1  # the server accepts a new connection slightly later than the client
SERVER_LOST_S = 5.0  # an action server that stays unadvertised for this time has ended


def is_heard(publisher: rospy.Publisher) -> bool:
    """Waits for a subscriber, because earlier messages are lost; logs an error and returns False without one."""
    if wait_until(lambda: publisher.get_num_connections() > 0, LISTENER_TIMEOUT_S):
        return True
    rospy.logerr("topic %s: no subscriber for %g s; does move_group run?", publisher.resolved_name, LISTENER_TIMEOUT_S)
    return False


class Servers:
    """Endpoints of a move_group node."""

    def __init__(self, ns: str = "") -> None:
        """Stores the namespace.

        Args:
            ns: Namespace of the move_group node's endpoints; "" for the namespace of this node.
        """
        accept_connections_at_once()  # this also affects the topics of the user's script
        self._ns = ns
        self._actions: dict[str, ActionCaller] = {}

    def resolve(self, name: str) -> str:
        """Returns the full name of an endpoint."""
        return str(rospy.resolve_name(ns_join(self._ns, name)))

    def call(self, name: str, kind: Any, request: Any, timeout_s: float = SERVICE_TIMEOUT_S) -> Any:
        """Calls a service and returns its response.

        Args:
            name: Name of the service.
            kind: Service class.
            request: Request message.
            timeout_s: Maximum wait for the service [s].

        Raises:
            ServerError: The service is not available in time, or fails, or a node is frozen.
        """
        proxy = rospy.ServiceProxy(self.resolve(name), kind)
        try:
            wait_for_service(proxy, timeout_s)
        except CallError as error:
            raise ServerError(f"{error}; does move_group run, and does it have this capability?") from error
        try:
            return call_service(proxy, request, math.inf)
        except CallError as error:
            raise ServerError(f"{error}; move_group's log gives the reason") from error

    def action(self, name: str, kind: Any, timeout_s: float = ACTION_TIMEOUT_S) -> ActionCaller:
        """Returns the connected client of an action.

        Args:
            name: Name of the action.
            kind: Action class.
            timeout_s: Maximum wait for the server [s]; as in MoveIt, 0 waits forever.

        Raises:
            ServerError: The server is not available in time.
        """
        if name not in self._actions:
            self._actions[name] = ActionCaller(self.resolve(name), kind)
        self._actions[name].connect(timeout_s)
        return self._actions[name]


class ActionCaller:
    """Client of an action server; timeouts use wall time, which also passes while a simulation is paused."""

    def __init__(self, name: str, kind: Any) -> None:
        self.name = name
        self._client = SteadyActionClient(name, kind)
        self._settled = False

    def connect(self, timeout_s: float) -> None:
        """Waits for the server; 0 waits forever. Raises ServerError."""
        begun = time.monotonic()
        while not is_connected(self._client):
            if rospy.is_shutdown() or 0.0 < timeout_s <= time.monotonic() - begun:
                raise ServerError(
                    f"action {self.name}: Unable to connect to its server within allotted time "
                    f"({timeout_s:g}s); does move_group run, and does it have this capability? "
                    f"Not connected: {', '.join(unconnected_topics(self._client))}"
                )
            self._refuse_frozen_nodes(begun)
            time.sleep(POLL_PERIOD_S)
        if not self._settled:
            time.sleep(SETTLE_S)
            self._settled = True

    def send(self, goal: Any) -> None:
        """Sends a goal without waiting; the result of the previous goal is ignored."""
        self._client.send_goal(goal)

    def run(self, goal: Any, timeout_s: float) -> Any:
        """Sends a goal and returns its result.

        Raises:
            ServerError: The result did not arrive in time (the goal is cancelled), the server is lost, or a node is
                frozen (the goal is cancelled, too).
        """
        done = threading.Event()
        self._client.send_goal(goal, done_cb=lambda _status, _result: done.set())
        begun = seen = time.monotonic()
        while not done.wait(POLL_PERIOD_S):
            now = time.monotonic()
            seen = now if is_connected(self._client) and not self._has_ended() else seen
            if rospy.is_shutdown():
                raise ServerError(f"action {self.name}: this node is shut down before the result came")
            if now - begun > timeout_s:
                self._client.cancel_goal()
                raise ServerError(f"action {self.name}: no result within {timeout_s:g} s; the goal is cancelled")
            self._refuse_frozen_nodes(begun)
            if now - seen > SERVER_LOST_S:
                raise ServerError(
                    f"action {self.name}: its server was lost, or ended the goal without a result, for "
                    f"{SERVER_LOST_S:g} s; has it died?"
                )
        result = self._client.get_result()
        if result is None:
            raise ServerError(
                f"action {self.name}: ended without a result ({self._client.get_goal_status_text()}); "
                "move_group's log gives the reason"
            )
        return result

    def _refuse_frozen_nodes(self, begun: float) -> None:
        if time.monotonic() - begun > WATCHED_AFTER_S and (frozen := frozen_nodes()):
            self._client.cancel_goal()
            raise ServerError(f"action {self.name} does not answer: {frozen}")

    def _has_ended(self) -> bool:
        """Returns whether the goal has ended on the server while its result has not arrived."""
        handle = self._client.gh
        return handle is not None and handle.get_comm_state() == CommState.WAITING_FOR_RESULT
