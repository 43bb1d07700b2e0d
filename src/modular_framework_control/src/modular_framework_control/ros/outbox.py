# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the messages of the control loop on a separate thread, so that the loop never waits for ROS."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any

import rospy

_Job = tuple[Callable[..., None], tuple[Any, ...]]


class Outbox:
    """Queues jobs that one thread runs in sequence.

    Args:
        backlog: Minimum number of queued jobs at which droppable jobs are dropped.
    """

    def __init__(self, backlog: int = 200) -> None:
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._backlog = backlog
        self._thread = threading.Thread(target=self._run, name="control_outbox", daemon=True)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def put(self, job: Callable[..., None], *arguments: Any) -> None:
        """Queues a job that must not be dropped, such as sending a result."""
        self._jobs.put((job, arguments))

    def put_droppable(self, job: Callable[..., None], *arguments: Any) -> None:
        """Queues a job, such as publishing a state, that is dropped if the queue is full."""
        if self._jobs.qsize() < self._backlog:
            self._jobs.put((job, arguments))

    def publish(self, publisher: rospy.Publisher, make_message: Callable[[], Any]) -> None:
        """Queues a message, unless the topic has no subscriber or the queue is full.

        Args:
            publisher: Publisher of the topic.
            make_message: Callback that returns the message; called on the thread of the outbox.
        """
        if publisher.impl.has_connections():  # publisher.get_num_connections() would wait for a lock
            self.put_droppable(lambda: publisher.publish(make_message()))

    def flush(self, timeout_s: float = 2.0) -> None:
        """Waits up to `timeout_s` [s] until all jobs queued so far have run."""
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            reached = threading.Event()
            self._jobs.put((reached.set, ()))
            if not reached.wait(timeout_s):
                rospy.logwarn("control outbox: messages are still queued after %.1f s", timeout_s)

    def close(self) -> None:
        """Runs the queued jobs, then ends the thread; may be called twice."""
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._jobs.put(None)
            self._thread.join(timeout=2.0)

    def _run(self) -> None:
        for job, arguments in iter(self._jobs.get, None):
            try:
                job(*arguments)
            except rospy.ROSException as error:
                rospy.logdebug("message not sent: %s", error)
            except Exception as error:  # an unsendable message must not stop the next messages
                rospy.logerr("control outbox: %s raised %s: %s", job, type(error).__name__, error)
