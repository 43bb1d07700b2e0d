# SPDX-License-Identifier: BSD-3-Clause
"""Lets a node with its own signal handlers finish its task before ROS shuts down, even after `rosnode kill`."""

from __future__ import annotations

import threading

import rospy

MAX_SHUTDOWN_DELAY_S = 15.0
"""Maximum delay of a shutdown [s]."""


def hold_shutdown(ended: threading.Event, longest_s: float = MAX_SHUTDOWN_DELAY_S) -> threading.Event:
    """Makes a shutdown of this node set `ended` and then wait; topics and services remain available during the wait.

    Args:
        ended: Event that ends the main thread.
        longest_s: Maximum delay of the shutdown [s].

    Returns:
        An event that the main thread sets when it has finished, before it requests the shutdown.
    """
    finished = threading.Event()

    def on_shutdown() -> None:
        ended.set()
        finished.wait(longest_s)

    rospy.on_shutdown(on_shutdown)
    return finished
