# SPDX-License-Identifier: BSD-3-Clause
"""Shows the recorded world of an episode at the shown time, in the viewer that also shows a running simulation."""

from __future__ import annotations

import sys
import threading

import numpy as np

from modular_framework_benchmark.episodes.recorded_scene import RecordedScene
from modular_framework_simulation.viewer.layers import Layer
from modular_framework_simulation.viewer.web_server import WebServer, free_port
from modular_framework_simulation.viewer.world_view import WorldView

FIRST_PORT = 8080
"""Port of the first world; each further world takes the next free port."""
_MIN_PERIOD_S = 1 / 25
"""Minimum time between two drawn moments [s]."""
_END_TIMEOUT_S = 5.0


class RecordedWorld:
    """Serves and draws a recorded scene; drawing has its own thread, because the meshes of a robot take seconds.

    Browsers that show the same episode see the latest shown time of any of them.

    Args:
        scene: Recorded scene.
        host: Address of the viewer.
        time_s: First shown time [s since the start of the recording].

    Raises:
        AddressError: The viewer cannot be served.
    """

    def __init__(self, scene: RecordedScene, host: str, time_s: float) -> None:
        self._scene, self._time_s = scene, time_s
        self._server = WebServer(host, free_port(host, FIRST_PORT))
        panel = self._server.viser.gui.main_panel  # is empty
        panel.float(x=-8, y=-8, width=200)
        panel.minimize()
        self._view = WorldView(Layer(self._server.viser, "world"), _report)
        self._changed, self._ended = threading.Event(), threading.Event()
        self._changed.set()
        self._thread = threading.Thread(target=self._draw_always, name="recorded world", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Returns the URL of the viewer."""
        return self._server.address

    def show(self, time_s: float) -> None:
        """Shows the world at a time [s since the start of the recording]; does not wait for the drawing."""
        self._time_s = time_s
        self._changed.set()

    def close(self) -> None:
        """Ends the viewer; may be called twice."""
        if not self._ended.is_set():
            self._ended.set()
            self._changed.set()
            self._thread.join(_END_TIMEOUT_S)
            self._server.close()

    def _draw_always(self) -> None:
        self._look_at_scene()
        while True:
            self._changed.wait()
            self._changed.clear()
            if self._ended.is_set():
                return
            poses = self._scene.poses(self._time_s)
            self._view.show(self._scene.models(poses))
            with self._server.viser.atomic():
                self._view.place(poses)
            self._ended.wait(_MIN_PERIOD_S)

    def _look_at_scene(self) -> None:
        """Points the camera at the robot, or without a robot at the moving models."""
        links = self._scene.robot_links(self._time_s)
        self._server.look_at(np.array([pose.position for pose in links] or [self._scene.centre]))


def _report(fault: str) -> None:
    print(f"page: {fault}", file=sys.stderr, flush=True)
