# SPDX-License-Identifier: BSD-3-Clause
"""Web server of the viewer: address, lights, and initial camera pose."""

from __future__ import annotations

import contextlib
import errno
import io
import socket
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.viewer.access import Access
from modular_framework_simulation.viewer.page_connections import PageConnections

_TITLE = "Modular Benchmarking Framework"
_MAX_PORTS = 100
_VIEW_DIRECTION = np.array([0.75, 0.55, 0.45])
_DISTANCE_RATIO = 1.5
"""Ratio of the camera distance to the size of the viewed region."""
_MIN_VIEW_SIZE_M = 0.8


class AddressError(SimulationError):
    """The page cannot be served at an address."""


def free_port(host: str, port: int) -> int:
    """Returns the port, or if it is in use, one of the next hundred ports.

    Raises:
        AddressError: The address does not belong to this machine, the port is not permitted, or all ports are in use.
    """
    if not 1 <= port <= 65535:
        raise AddressError(f"port {port} does not exist; allowed: 1 to 65535")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in range(port, min(port + _MAX_PORTS, 65536)):
        try:
            with socket.create_server((host, candidate), family=family):
                return candidate
        except OSError as error:
            fault = error
            if error.errno != errno.EADDRINUSE:
                break
    raise AddressError(f"cannot listen on {host}, port {port}: {fault}; use another address or port") from fault


class WebServer:
    """Serves the page.

    Args:
        host: Address of the server.
        port: Unused port.
    """

    def __init__(self, host: str, port: int) -> None:
        import viser  # takes a second to import

        self._access, self._connections = Access(), PageConnections()
        hooks = self._access.enforce_checks(create_connection=self._connections.create_connection)
        with contextlib.redirect_stdout(io.StringIO()), hooks:  # without viser's banner
            self.viser: Any = viser.ViserServer(host=host, port=port, label=_TITLE, verbose=False)
        self.host, self.port = host, int(self.viser.get_port())
        self.viser.gui.configure_theme(
            control_layout="collapsible",  # beside the scene, because a floating panel would hide a part of the scene
            show_share_button=False,
            show_logo=False,
            dark_mode=False,
        )
        self._grid = self.viser.scene.add_grid("/grid", width=10.0, height=10.0, cell_size=0.1, visible=False)
        self._shadows: bool | None = None
        self.show_shadows(True)

    @property
    def address(self) -> str:
        """Returns the URL of the page."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/{self._access.token}/"

    @property
    def has_clients(self) -> bool:
        """Returns whether a browser is connected."""
        return self._connections.has_browser

    def show_grid(self, visible: bool) -> None:
        """Shows or hides the grid at z = 0 with a spacing of 0.1 m."""
        if self._grid.visible != visible:
            self._grid.visible = visible

    def show_shadows(self, on: bool) -> None:
        """Enables or disables shadows."""
        if self._shadows != on:
            self._shadows = on
            self.viser.scene.configure_default_lights(enabled=True, cast_shadow=on)

    def look_at(self, points: NDArray[np.float64]) -> None:
        """Points the cameras of all current and future clients at a set of points.

        Args:
            points: Points in the fixed frame, shape (n, 3) [m].
        """
        low, high = points.min(axis=0), points.max(axis=0)
        centre, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), _MIN_VIEW_SIZE_M)
        position = centre + _VIEW_DIRECTION * size * _DISTANCE_RATIO
        for camera in (self.viser.initial_camera, *(client.camera for client in self.viser.get_clients().values())):
            camera.position = position
            camera.look_at = centre

    def close(self) -> None:
        """Stops the server, whatever the browsers do."""
        self._connections.close(self.viser.get_event_loop())
        self.viser.stop()
