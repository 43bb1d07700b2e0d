# SPDX-License-Identifier: BSD-3-Clause
"""Stops a state machine on the shutdown of ROS, while its states can still reach other nodes."""

from __future__ import annotations

import time

import rospy

import smach

__all__ = ["set_preempt_handler"]

STOP_TIME_S = 5.0
"""Maximum time for a machine to stop before ROS shuts down [s]."""


def set_preempt_handler(sc: smach.Container) -> None:
    """Requests preemption of a container on the shutdown of ROS, and delays the shutdown until it stops or for 5 s.

    Execute the container in a separate thread, because the thread that receives SIGINT waits.

    Args:
        sc: Outermost container.

    Raises:
        smach.InvalidStateError: The object is not a container.
    """
    if not isinstance(sc, smach.Container):
        raise smach.InvalidStateError(f"set_preempt_handler needs a container, got a {type(sc).__name__}")

    def stop() -> None:
        sc.request_preempt()
        end = time.monotonic() + STOP_TIME_S
        while sc.is_running():
            if time.monotonic() >= end:
                active = sc.get_active_states()
                rospy.logwarn(f"the state machine did not stop within {STOP_TIME_S} s: {active}")
                return
            time.sleep(0.02)

    rospy.core.add_client_shutdown_hook(stop)
