# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the state machine of a running task for viewers, without delaying or failing the task.

Publishers: ``<node>/smach/container_structure``, ``<node>/smach/container_status`` (smach_msgs). Viewers cannot change
the task, because there is no subscriber.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy

import smach

START_DELAY_S = 0.3
"""Delay of the publishers, so that they do not slow down the start of the task [s]."""


class TaskIntrospection:
    """Publishes the state machine of one run of a task, from its construction to `stop`.

    Must be created before the run, because importing smach_ros sets smach's shutdown check, which the run replaces.

    Args:
        name: Name of the task and root of the published paths.
        factory: Function that creates the state machine.
    """

    def __init__(self, name: str, factory: Callable[[], smach.Container]) -> None:
        self._path, self._factory = "/" + name.replace("/", "_"), factory
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._server: Any = None
        self._can_publish = True
        try:
            import smach_ros  # noqa: F401 - connects smach to rospy; imported here, not at import of this module
        except Exception as error:  # the task also runs without viewers
            rospy.logwarn(f"the task is not published for viewers: {error}")
            self._can_publish = False

    def make_machine(self) -> smach.Container:
        """Returns the state machine, and publishes it soon after."""
        machine = self._factory()
        if self._can_publish:
            # runs in a thread, because advertising takes several calls to the master and would delay the first state
            threading.Thread(target=self._start, args=(machine,), name="task introspection", daemon=True).start()
        return machine

    def stop(self) -> None:
        """Stops publishing, so that viewers do not receive the ended run beside the next run. May be called twice."""
        self._stopped.set()
        with self._lock:
            if self._server is not None:
                self._server.stop()

    def _start(self, machine: smach.Container) -> None:
        """Starts the introspection server; body of the thread."""
        from smach_ros import IntrospectionServer

        if self._stopped.wait(START_DELAY_S) or rospy.is_shutdown():
            return
        try:
            with self._lock:
                if self._stopped.is_set():
                    return
                self._server = IntrospectionServer(rospy.get_name(), machine, self._path, accept_commands=False)
                self._server.start()
        except Exception as error:  # the task also runs without viewers
            if not rospy.is_shutdown():
                rospy.logwarn(f"the task is not published for viewers: {type(error).__name__}: {error}")
