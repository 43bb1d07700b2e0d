# SPDX-License-Identifier: BSD-3-Clause
"""Light services, which this simulation does not support."""

from __future__ import annotations

from typing import Any

from gazebo_msgs import srv

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints


class LightServices:
    """Responds to /gazebo/{get,set}_light_properties and delete_light with an error, as lights are not supported."""

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the services."""
        for name, kind in (
            (ros_names.GET_LIGHT_PROPERTIES, srv.GetLightProperties),
            (ros_names.SET_LIGHT_PROPERTIES, srv.SetLightProperties),
            (ros_names.DELETE_LIGHT, srv.DeleteLight),
        ):
            endpoints.serve_outside_loop(name, kind, _refuse)


def _refuse(request: Any) -> Any:
    raise ValueError(
        f"light '{request.light_name}': lights are not supported; this simulation renders with its own light, "
        "and lights of world files have no effect"
    )
