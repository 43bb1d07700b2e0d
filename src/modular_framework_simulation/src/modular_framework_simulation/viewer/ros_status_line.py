# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the status line of the page true while the drawing thread is busy with large meshes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import rosgraph
import rospy

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.viewer.control_panel import ControlPanel
from modular_framework_simulation.viewer.simulation_status import Phase, SimulationWatch

_PERIOD_S = 0.25
_SEARCH_PERIOD_S = 2.0


class StatusLine:
    """Searches for a simulation and shows its status, while a browser is connected.

    Args:
        panel: Panel with the line.
        watch: Knowledge about the simulation.
        has_clients: Function that returns whether a browser is connected.
        guard: Function that runs a named function and logs its exceptions.

    Attributes:
        activity: Activity of the drawing thread, which the line adds to the status; empty for none.
    """

    def __init__(
        self,
        panel: ControlPanel,
        watch: SimulationWatch,
        has_clients: Callable[[], bool],
        guard: Callable[[str, Callable[[], None]], None],
    ) -> None:
        self._panel, self._watch, self._has_clients, self._guard = panel, watch, has_clients, guard
        self._phase = Phase.SEARCHING
        self._search_due_s = 0.0
        self.activity = ""

    def run(self) -> None:
        """Updates the line until ROS shuts down."""
        while not rospy.is_shutdown():
            self._guard("showing the status", self._update)
            time.sleep(_PERIOD_S)

    def _update(self) -> None:
        if not self._has_clients():
            self._watch.forget()  # the next browser must not see the time of the previous browser
            self._search_due_s = 0.0
        elif time.monotonic() >= self._search_due_s:
            self._search_due_s = time.monotonic() + _SEARCH_PERIOD_S
            self._watch.note_search(_has_service(ros_names.PAUSE_PHYSICS))
        status = self._watch.status(time.monotonic())
        self._panel.show_status(status, self.activity)
        if status.phase is Phase.RUNNING and self._phase is not Phase.RUNNING:
            # in a thread, because a busy simulation responds late
            threading.Thread(
                target=self._guard, args=("reading the speed", self._panel.refresh_speed), daemon=True
            ).start()
        self._phase = status.phase


def _has_service(name: str) -> bool | None:
    """Returns whether a service is registered; None if the master does not respond."""
    try:
        rosgraph.Master(rospy.get_name()).lookupService(name)
    except rosgraph.MasterError:
        return False
    except (rosgraph.MasterException, OSError):
        return None
    return True
