# SPDX-License-Identifier: BSD-3-Clause
"""Lets a node that handles its signals itself finish its work before ROS shuts down, also after `rosnode kill`."""

from __future__ import annotations

import threading

import rospy

LONGEST_END_S = 15.0
"""How long a shutdown waits for the work that is left [s]."""


def hold_shutdown(ended: threading.Event, longest_s: float = LONGEST_END_S) -> threading.Event:
    """Makes a shutdown of this node set `ended` and then wait; topics and services work as long as it waits.

    Args:
        ended: set to request that the main thread ends.
        longest_s: how long the shutdown waits [s].

    Returns:
        An event that the main thread sets when its work is done, before it requests the shutdown itself.
    """
    finished = threading.Event()

    def on_shutdown() -> None:
        ended.set()
        finished.wait(longest_s)

    rospy.on_shutdown(on_shutdown)
    return finished
