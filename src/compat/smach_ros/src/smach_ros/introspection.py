# SPDX-License-Identifier: BSD-3-Clause
"""Publishes a running state machine for viewers, which may set its initial states."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

import rospy
from smach_msgs.msg import SmachContainerInitialStatusCmd, SmachContainerStatus, SmachContainerStructure
from std_msgs.msg import Header

import smach
from smach_ros.userdata_wire import UserdataError, decode, encode
from smach_ros.waiting import seconds

__all__ = ["IntrospectionClient", "IntrospectionServer"]

STATUS_TOPIC = "/smach/container_status"
INIT_TOPIC = "/smach/container_init"
STRUCTURE_TOPIC = "/smach/container_structure"

UPDATE_PERIOD_S = 2.0
"""Period of full updates [wall time]."""

MIN_QUEUE = 100


def _values(userdata: smach.UserData) -> dict[str, Any]:
    keys = list(userdata.keys())
    return {key: userdata[key] for key in keys}


class ContainerProxy:
    """Messages of a container."""

    def __init__(self, container: smach.Container, path: str) -> None:
        """Stores a container and its path from the root."""
        self.container = container
        self.path = path

    def structure(self) -> SmachContainerStructure:
        """Returns the message with the states and transitions."""
        edges = self.container.get_internal_edges()
        return SmachContainerStructure(
            header=Header(stamp=rospy.Time.now()),
            path=self.path,
            children=list(self.container.get_children()),
            internal_outcomes=[str(outcome) for outcome, _, _ in edges],
            outcomes_from=[str(label) for _, label, _ in edges],
            outcomes_to=[str(target) for _, _, target in edges],
            container_outcomes=list(self.container.get_registered_outcomes()),
        )

    def status(self, info: str) -> SmachContainerStatus:
        """Returns the message with the active states and the userdata."""
        return SmachContainerStatus(
            header=Header(stamp=rospy.Time.now()),
            path=self.path,
            initial_states=[str(label) for label in self.container.get_initial_states()],
            active_states=[str(label) for label in self.container.get_active_states()],
            local_data=encode(_values(self.container.userdata)),
            info=info,
        )

    def set_initial_state(self, command: SmachContainerInitialStatusCmd) -> None:
        """Executes a viewer's command.

        Raises:
            smach.SmachError: The container lacks a state.
            UserdataError: The userdata is invalid.
        """
        children = self.container.get_children()
        unknown = [label for label in command.initial_states if label not in children]
        if unknown:
            raise smach.InvalidStateError(f"there are no states {unknown}; there are {list(children)}")
        userdata = smach.UserData()
        for key, value in decode(command.local_data).items():
            userdata[key] = value
        self.container.set_initial_state(list(command.initial_states), userdata)


class _NewSubscriber(rospy.SubscribeListener):
    """Sets an event when a node subscribes."""

    def __init__(self, event: threading.Event) -> None:
        super().__init__()
        self._event = event

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Callback of rospy."""
        self._event.set()


class IntrospectionServer:
    """Publishes structure and status of a container and all nested containers.

    Messages are created only for subscribers: all messages for a new subscriber, and updates when a container starts,
    ends or makes a transition, and every two seconds.
    Publishers: ``<server_name>/smach/container_structure``, ``<server_name>/smach/container_status``.
    Subscriber: ``<server_name>/smach/container_init``.
    """

    def __init__(self, server_name: str, state: smach.Container, path: str, *, accept_commands: bool = True) -> None:
        """Creates the server; ``start`` starts it.

        Args:
            server_name: Prefix of the topics' names.
            state: Outermost container.
            path: Path of the container, such as "/TASK".
            accept_commands: Whether viewers may set initial states and userdata.

        Raises:
            smach.InvalidStateError: The state is not a container, or the path does not begin with "/".
        """
        if not isinstance(state, smach.Container):
            raise smach.InvalidStateError(f"introspection needs a container, got a {type(state).__name__}")
        if not path.startswith("/"):
            raise smach.InvalidStateError(f"the path of the outermost container must begin with '/', got '{path}'")
        self._server_name = server_name
        self._state = state
        self._path = path
        self._accept_commands = accept_commands
        self._proxies: list[ContainerProxy] = []
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._running = False
        self._run_number = 0
        self._topics: list[Any] = []

    def start(self) -> None:
        """Advertises the topics and starts to publish; a stopped server can be restarted."""
        with self._lock:
            if self._running:
                return
            if not self._proxies:
                self.construct(self._server_name, self._state, self._path)
            self._advertise()
            self._running = True  # the containers' callbacks publish from here on
            self._run_number += 1
            arguments = (self._run_number,)
        threading.Thread(
            target=self._publish_loop, args=arguments, name=f"{self._server_name} introspection", daemon=True
        ).start()

    def _advertise(self) -> None:
        queue = max(MIN_QUEUE, 2 * len(self._proxies))
        listener = _NewSubscriber(self._wake)
        name = self._server_name
        self._structure_pub = rospy.Publisher(
            name + STRUCTURE_TOPIC, SmachContainerStructure, listener, queue_size=queue
        )
        self._status_pub = rospy.Publisher(name + STATUS_TOPIC, SmachContainerStatus, listener, queue_size=queue)
        self._topics = [self._structure_pub, self._status_pub]
        if self._accept_commands:
            self._topics.append(rospy.Subscriber(name + INIT_TOPIC, SmachContainerInitialStatusCmd, self._on_command))

    def stop(self) -> None:
        """Unregisters the topics; repeated calls are allowed."""
        with self._lock:
            self._running = False
            topics, self._topics = self._topics, []
        self._wake.set()
        for topic in topics:
            topic.unregister()

    def construct(self, server_name: str, state: smach.Container, path: str) -> None:
        """Registers a container and all nested containers.

        Args:
            server_name: Prefix of the topics' names.
            state: Container.
            path: Path of the container.
        """
        proxy = ContainerProxy(state, path)
        self._proxies.append(proxy)

        def changed(*_: Any) -> None:
            self._publish_status(proxy, f"active: {', '.join(state.get_active_states())}")

        state.register_start_cb(changed)
        state.register_transition_cb(changed)
        state.register_termination_cb(changed)
        for label, child in state.get_children().items():
            if isinstance(child, smach.Container):
                self.construct(server_name, child, f"{path.rstrip('/')}/{label}")

    def clear(self) -> None:
        """Removes all containers."""
        self._proxies = []

    def _publish_loop(self, run_number: int) -> None:
        """Thread body: publishes all messages periodically and for new subscribers."""
        while self._running and self._run_number == run_number and not rospy.is_shutdown():
            self._wake.clear()
            for proxy in list(self._proxies):
                self._publish_structure(proxy)
                self._publish_status(proxy, "HEARTBEAT")
            self._wake.wait(UPDATE_PERIOD_S)

    def _publish_structure(self, proxy: ContainerProxy) -> None:
        if self._running:
            self._send(self._structure_pub, proxy.structure)

    def _publish_status(self, proxy: ContainerProxy, info: str) -> None:
        if self._running:
            self._send(self._status_pub, lambda: proxy.status(info))

    def _send(self, publisher: rospy.Publisher, make: Callable[[], Any]) -> None:
        """Creates and publishes a message if there are subscribers, so that introspection costs nothing otherwise."""
        try:
            if publisher.get_num_connections() > 0:
                publisher.publish(make())
        except Exception as error:
            if self._running and not rospy.is_shutdown():
                rospy.logwarn_throttle(10.0, f"the state machine could not be shown: {type(error).__name__}: {error}")

    def _on_command(self, command: SmachContainerInitialStatusCmd) -> None:
        for proxy in list(self._proxies):
            if proxy.path != command.path:
                continue
            try:
                proxy.set_initial_state(command)
            except (smach.SmachError, UserdataError) as error:
                rospy.logerr(f"initial state of '{command.path}' not set: {error}")
            else:
                self._publish_status(proxy, "REMOTE_INIT")
            return


class IntrospectionClient:
    """Finds introspection servers and sends commands to them."""

    def __init__(self) -> None:
        """Creates a client that connects on demand."""
        self._publishers: dict[str, rospy.Publisher] = {}

    def get_servers(self) -> list[str]:
        """Returns the names of the active servers."""
        return [
            topic[: -len(STATUS_TOPIC)]
            for topic, kind in rospy.get_published_topics()
            if kind == SmachContainerStatus._type and topic.endswith(STATUS_TOPIC)
        ]

    def set_initial_state(
        self,
        server: str,
        path: str,
        initial_states: Iterable[str],
        initial_userdata: smach.UserData | None = None,
        timeout: rospy.Duration | None = None,
    ) -> bool | None:
        """Sets the initial states of a container.

        Args:
            server: Name of the server.
            path: Path of the container.
            initial_states: Labels of the container's initial states.
            initial_userdata: Plain values and messages to add to the container's userdata.
            timeout: Maximum wait for the effect [wall time]; None to return immediately.

        Returns:
            Whether the container accepted the states; None without waiting.

        Raises:
            UserdataError: A value cannot be sent.
        """
        labels = list(initial_states)
        userdata = smach.UserData() if initial_userdata is None else initial_userdata
        values = _values(userdata)
        command = SmachContainerInitialStatusCmd(path, labels, encode(values, strict=True))
        if server not in self._publishers:
            self._publishers[server] = rospy.Publisher(
                server + INIT_TOPIC, SmachContainerInitialStatusCmd, queue_size=1, latch=True
            )
        publisher = self._publishers[server]
        timeout_s = seconds("timeout", timeout)
        if timeout_s is None:
            publisher.publish(command)
            return None
        return _send_until_shown(publisher, server, command, values, timeout_s)


def _send_until_shown(
    publisher: rospy.Publisher,
    server: str,
    command: SmachContainerInitialStatusCmd,
    values: dict[str, Any],
    timeout_s: float,
) -> bool:
    """Repeats a command until a status shows its effect.

    Args:
        publisher: Publisher of the command.
        server: Name of the server.
        command: Command to send.
        values: Expected userdata values.
        timeout_s: Maximum wait [s].

    Returns:
        Whether the effect was seen in time.
    """
    shown_by_server = threading.Event()

    def on_status(status: SmachContainerStatus) -> None:
        if status.path != command.path or not set(command.initial_states) <= set(status.initial_states):
            return
        try:
            shown = decode(status.local_data)
        except UserdataError as error:
            rospy.logwarn_throttle(10.0, f"status of '{server}' cannot be read: {error}")
            return
        if all(key in shown and shown[key] == value for key, value in values.items()):
            shown_by_server.set()

    subscriber = rospy.Subscriber(server + STATUS_TOPIC, SmachContainerStatus, on_status)
    end = time.monotonic() + timeout_s
    try:
        while not shown_by_server.is_set() and time.monotonic() < end and not rospy.is_shutdown():
            publisher.publish(command)
            shown_by_server.wait(max(0.0, min(0.3, end - time.monotonic())))
    finally:
        subscriber.unregister()
    return shown_by_server.is_set()
