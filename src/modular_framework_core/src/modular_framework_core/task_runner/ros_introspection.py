# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the state machine of a running task for viewers; the task never waits for this or fails because of it.

Publishers: ``<node>/smach/container_structure``, ``<node>/smach/container_status`` (smach_msgs). Viewers can watch, but
not change the task: there is no subscriber.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import rospy

import smach

START_DELAY_S = 0.3
"""Delay of the publishers, so that they do not slow the start of the task down [s]."""


def shown(name: str, factory: Callable[[], smach.Container]) -> Callable[[], smach.Container]:
    """Returns a function that makes the same machine and has it shown.

    To be called before the run begins: the import puts rospy's shutdown check in smach, and the run puts its own there.

    Args:
        name: Name of the task: the root of the paths shown.
        factory: Makes the state machine.
    """
    try:
        import smach_ros  # noqa: F401 - connects smach to rospy, therefore not wherever this module is imported
    except Exception as error:  # a task runs without viewers too
        rospy.logwarn(f"the task is not shown to viewers: {error}")
        return factory

    def make() -> smach.Container:
        machine = factory()
        # in a thread, and later: advertising asks the master several times; the first state is not to wait for that
        thread = threading.Thread(target=_show, args=(machine, name), name="task introspection", daemon=True)
        thread.start()
        return machine

    return make


def _show(machine: smach.Container, name: str) -> None:
    """Body of the thread: start the server."""
    from smach_ros import IntrospectionServer

    threading.Event().wait(START_DELAY_S)
    if rospy.is_shutdown():
        return
    try:
        path = "/" + name.replace("/", "_")
        IntrospectionServer(rospy.get_name(), machine, path, accept_commands=False).start()
    except Exception as error:  # a task runs without viewers too
        if not rospy.is_shutdown():
            rospy.logwarn(f"the task is not shown to viewers: {type(error).__name__}: {error}")
