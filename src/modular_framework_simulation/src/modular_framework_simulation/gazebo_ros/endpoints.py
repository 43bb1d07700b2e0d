# SPDX-License-Identifier: BSD-3-Clause
"""Services and subscriptions whose work is done by the simulation loop.

Each handler runs in a thread of its own. A failure is reported in the answer, by `success` and `status_message`, or, by
types that have no room for it, as a failed call with the reason; never by an exception that ends something.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.loop.simulation_loop import SimulationLoop

_ANSWER_TIMEOUT_S = 30.0
_TOPIC_QUEUE_SIZE = 10

Work = Callable[[Any], Any]
"""Takes a request or a message; returns the answer."""


class Endpoints:
    """Opens services and subscriptions, and closes them together.

    Args:
        loop: Does the work.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self._loop = loop
        self._opened: list[Any] = []

    def in_loop(self, what: str, work: Callable[[], Any]) -> Any:
        """Has work done by the loop's thread, and returns its result."""
        return self._loop.requests.call(what, work, _ANSWER_TIMEOUT_S)

    def serve(self, name: str, kind: Any, work: Work) -> None:
        """Advertises a service whose answer has `success` and `status_message`; the loop does its work."""
        self.serve_beside(name, kind, lambda request: self.in_loop(name, lambda: work(request)))

    def serve_beside(self, name: str, kind: Any, work: Work) -> None:
        """Advertises such a service whose work is done in the thread of the request, beside the loop."""

        def handle(request: Any) -> Any:
            try:
                answer = work(request)
                self._note(name, request)
                return answer
            except Exception as error:  # any request must get an answer and must not end the node
                return kind._response_class(success=False, status_message=f"{name}: {_reason(name, error)}")

        self._opened.append(rospy.Service(name, kind, handle))

    def command(self, name: str, kind: Any, work: Callable[[Any], None]) -> None:
        """Advertises a service with an empty answer; where the work fails, so does the call, with the reason."""

        def handle(request: Any) -> Any:
            try:
                self.in_loop(name, lambda: work(request))
                self._note(name, request)
            except Exception as error:  # any request must get an answer and must not end the node
                raise rospy.ServiceException(f"{name}: {_reason(name, error)}") from None
            return kind._response_class()

        self._opened.append(rospy.Service(name, kind, handle))

    def subscribe(self, topic: str, kind: Any, work: Callable[[Any], None]) -> None:
        """Subscribes to a topic; the loop does the work, and a failure is logged."""

        def handle(message: Any) -> None:
            def attempt() -> None:
                try:
                    work(message)
                    self._note(topic, message)
                except Exception as error:  # no message may end the loop
                    _reason(f"{topic} (topic)", error)

            self._loop.requests.post(attempt)

        self._opened.append(rospy.Subscriber(topic, kind, handle, queue_size=_TOPIC_QUEUE_SIZE))

    def _note(self, name: str, message: Any) -> None:
        """Notes a request or message that changed the world."""
        if ros_names.READING not in name:
            self._loop.referee.note(name, caller_of(message))

    def close(self) -> None:
        """Closes everything; may be called twice."""
        while self._opened:
            endpoint = self._opened.pop()
            if isinstance(endpoint, rospy.Service):
                endpoint.shutdown("the simulation ends")
            else:
                endpoint.unregister()


def caller_of(message: Any) -> str:
    """Returns the name that the sender of a request or message gave; ROS 1 does not verify it."""
    return str((getattr(message, "_connection_header", None) or {}).get("callerid", ""))


def _reason(name: str, error: Exception) -> str:
    """Returns why something failed, and logs it."""
    known = isinstance(error, SimulationError | ValueError)
    text = str(error) if known else f"unexpected {type(error).__name__}: {error}"
    rospy.logerr("%s: %s", name, text)
    return text
