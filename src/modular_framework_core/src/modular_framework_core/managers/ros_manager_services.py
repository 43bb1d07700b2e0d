# SPDX-License-Identifier: BSD-3-Clause
"""Base class of the managers' ROS interfaces."""

from __future__ import annotations

import rospy


class ManagerServices:
    """A set of services that are shut down together."""

    def __init__(self) -> None:
        self._services: list[rospy.Service] = []

    def close(self) -> None:
        """Shuts down the services. May be called twice."""
        while self._services:
            self._services.pop().shutdown("the manager is closed")
