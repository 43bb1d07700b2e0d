# SPDX-License-Identifier: BSD-3-Clause
"""Stops a state machine when ROS shuts down, while its states can still reach other nodes."""

from __future__ import annotations

import time

import rospy

import smach

__all__ = ["set_preempt_handler"]

STOP_TIME_S = 5.0
"""How long a machine has to stop [s] before ROS shuts down all the same."""


def set_preempt_handler(sc: smach.Container) -> None:
    """Asks a container to stop when ROS is asked to shut down, and holds the shutdown until it has, or 5 s are over.

    The container is to be executed in a thread of its own: the one that received SIGINT is the one that waits.

    Args:
        sc: the outermost container.

    Raises:
        smach.InvalidStateError: it is no container.
    """
    if not isinstance(sc, smach.Container):
        raise smach.InvalidStateError(f"set_preempt_handler needs a container, got a {type(sc).__name__}")

    def stop() -> None:
        sc.request_preempt()
        end = time.monotonic() + STOP_TIME_S
        while sc.is_running():
            if time.monotonic() >= end:
                active = sc.get_active_states()
                rospy.logwarn(f"the state machine was asked to stop and did not within {STOP_TIME_S} s: {active}")
                return
            time.sleep(0.02)

    rospy.core.add_client_shutdown_hook(stop)
