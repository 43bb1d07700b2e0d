# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the state machine of a running task for viewers, without delaying or failing the task.

Publishers: ``<node>/smach/container_structure``, ``<node>/smach/container_status`` (smach_msgs). Viewers cannot change
the task, because there is no subscriber.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import rospy

import smach

START_DELAY_S = 0.3
"""Delay of the publishers, so that they do not slow down the start of the task [s]."""


def with_introspection(name: str, factory: Callable[[], smach.Container]) -> Callable[[], smach.Container]:
    """Returns a factory that also publishes its state machine.

    Must be called before the run, because importing smach_ros sets smach's shutdown check, which the run replaces.

    Args:
        name: Name of the task and root of the published paths.
        factory: Function that creates the state machine.
    """
    try:
        import smach_ros  # noqa: F401 - connects smach to rospy; imported here, not at import of this module
    except Exception as error:  # the task also runs without viewers
        rospy.logwarn(f"the task is not published for viewers: {error}")
        return factory

    def make_and_publish() -> smach.Container:
        machine = factory()
        # runs in a thread, because advertising takes several calls to the master and would delay the first state
        thread = threading.Thread(target=_start_server, args=(machine, name), name="task introspection", daemon=True)
        thread.start()
        return machine

    return make_and_publish


def _start_server(machine: smach.Container, name: str) -> None:
    """Starts the introspection server; body of the thread."""
    from smach_ros import IntrospectionServer

    threading.Event().wait(START_DELAY_S)
    if rospy.is_shutdown():
        return
    try:
        path = "/" + name.replace("/", "_")
        IntrospectionServer(rospy.get_name(), machine, path, accept_commands=False).start()
    except Exception as error:  # the task also runs without viewers
        if not rospy.is_shutdown():
            rospy.logwarn(f"the task is not published for viewers: {type(error).__name__}: {error}")
