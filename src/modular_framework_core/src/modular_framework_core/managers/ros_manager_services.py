# SPDX-License-Identifier: BSD-3-Clause
"""The services of a manager."""

from __future__ import annotations

import rospy


class ManagerServices:
    """Services that are withdrawn together."""

    def __init__(self) -> None:
        self._services: list[rospy.Service] = []

    def close(self) -> None:
        """Withdraws the services; may be called twice."""
        while self._services:
            self._services.pop().shutdown("the manager is closed")
