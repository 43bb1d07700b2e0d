# SPDX-License-Identifier: BSD-3-Clause
"""Services and subscriptions whose work is done by the simulation loop.

Each handler runs in its own thread. A failure is reported in the response, by `success` and `status_message`, or as a
failed call for types without these fields. A failure never ends the loop or the node.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.loop.simulation_loop import SimulationLoop

_RESPONSE_TIMEOUT_S = 30.0
_TOPIC_QUEUE_SIZE = 10

Handler = Callable[[Any], Any]
"""Function that handles a request or message and returns the response."""


class Endpoints:
    """Opens services and subscriptions, and closes them together.

    Args:
        loop: Loop that does the work.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self._loop = loop
        self._opened: list[Any] = []

    def in_loop(self, name: str, handler: Callable[[], Any]) -> Any:
        """Runs work in the loop's thread and returns the result."""
        return self._loop.requests.call(name, handler, _RESPONSE_TIMEOUT_S)

    def serve(self, name: str, kind: Any, handler: Handler) -> None:
        """Advertises a service with `success` and `status_message`, handled by the loop's thread.

        Args:
            name: Name of the service.
            kind: Type of the service.
            handler: Function that handles a request.
        """
        self.serve_outside_loop(name, kind, lambda request: self.in_loop(name, lambda: handler(request)))

    def serve_outside_loop(self, name: str, kind: Any, handler: Handler) -> None:
        """Advertises a service with `success` and `status_message`, handled by the request's thread.

        Args:
            name: Name of the service.
            kind: Type of the service.
            handler: Function that handles a request.
        """

        def handle(request: Any) -> Any:
            try:
                response = handler(request)
                self._note(name, request)
                return response
            except Exception as error:  # any request must get a response and must not end the node
                return kind._response_class(success=False, status_message=f"{name}: {_reason(name, error)}")

        self._opened.append(rospy.Service(name, kind, handle))

    def command(self, name: str, kind: Any, handler: Callable[[Any], None]) -> None:
        """Advertises a service with an empty response; if the work fails, the call fails with the reason.

        Args:
            name: Name of the service.
            kind: Type of the service.
            handler: Function that handles a request in the loop's thread.
        """

        def handle(request: Any) -> Any:
            try:
                self.in_loop(name, lambda: handler(request))
                self._note(name, request)
            except Exception as error:  # any request must get a response and must not end the node
                raise rospy.ServiceException(f"{name}: {_reason(name, error)}") from None
            return kind._response_class()

        self._opened.append(rospy.Service(name, kind, handle))

    def subscribe(self, topic: str, kind: Any, handler: Callable[[Any], None]) -> None:
        """Subscribes to a topic; a failure is logged.

        Args:
            topic: Name of the topic.
            kind: Type of the messages.
            handler: Function that handles a message in the loop's thread.
        """

        def handle(message: Any) -> None:
            def attempt() -> None:
                try:
                    handler(message)
                    self._note(topic, message)
                except Exception as error:  # a message must not end the loop
                    _reason(f"{topic} (topic)", error)

            self._loop.requests.post(attempt)

        self._opened.append(rospy.Subscriber(topic, kind, handle, queue_size=_TOPIC_QUEUE_SIZE))

    def _note(self, name: str, message: Any) -> None:
        """Records a request or message that changed the world."""
        if ros_names.READ_ONLY_PREFIX not in name:
            self._loop.referee.note(name, caller_of(message))

    def close(self) -> None:
        """Closes all services and subscriptions; may be called twice."""
        while self._opened:
            endpoint = self._opened.pop()
            if isinstance(endpoint, rospy.Service):
                endpoint.shutdown("the simulation ends")
            else:
                endpoint.unregister()


def caller_of(message: Any) -> str:
    """Returns the sender's name in a request or message, which ROS 1 does not verify."""
    return str((getattr(message, "_connection_header", None) or {}).get("callerid", ""))


def _reason(name: str, error: Exception) -> str:
    """Returns the reason for a failure, and logs the reason."""
    known = isinstance(error, SimulationError | ValueError)
    text = str(error) if known else f"unexpected {type(error).__name__}: {error}"
    rospy.logerr("%s: %s", name, text)
    return text
