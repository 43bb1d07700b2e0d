# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's services and topics, provided by the simulated world."""

from __future__ import annotations

from typing import Any

from gazebo_msgs import srv

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.gazebo_ros.joint_services import JointServices
from modular_framework_simulation.gazebo_ros.link_services import LinkServices
from modular_framework_simulation.gazebo_ros.model_services import ModelServices
from modular_framework_simulation.gazebo_ros.perception_service import PerceptionService
from modular_framework_simulation.gazebo_ros.physics_services import PhysicsServices
from modular_framework_simulation.loop.perception_errors import PerceptionErrors
from modular_framework_simulation.loop.simulation_loop import SimulationLoop
from modular_framework_simulation.models.sdf_resources import Resources

_LIGHT_SERVICES = {
    ros_names.GET_LIGHT_PROPERTIES: srv.GetLightProperties,
    ros_names.SET_LIGHT_PROPERTIES: srv.SetLightProperties,
    ros_names.DELETE_LIGHT: srv.DeleteLight,
}


class GazeboServices:
    """Serves all names of gazebo_ros below /gazebo, and the service for errors of perception.

    See `ModelServices`, `LinkServices`, `JointServices`, `PhysicsServices` and `PerceptionService`. Requests about
    lights get an error.

    Args:
        loop: Loop with the world and the pacer.
        resources: Folders and packages for the files of spawned models.
        perception: Displacements of models in the planning scene.
    """

    def __init__(self, loop: SimulationLoop, resources: Resources, perception: PerceptionErrors) -> None:
        self._endpoints = Endpoints(loop)
        self._physics = PhysicsServices(loop)
        self._groups = (
            ModelServices(loop, resources),
            LinkServices(loop.world),
            JointServices(loop.world),
            PerceptionService(perception),
            self._physics,
        )

    def connect(self) -> None:
        """Opens all services and subscriptions."""
        for group in self._groups:
            group.connect(self._endpoints)
        for name, kind in _LIGHT_SERVICES.items():
            self._endpoints.serve_outside_loop(name, kind, _refuse_lights)

    def refresh(self) -> None:
        """Publishes the physics settings after a restart has restored the initial settings."""
        self._physics.refresh()

    def close(self) -> None:
        """Closes all services and subscriptions; may be called twice."""
        self._physics.close()
        self._endpoints.close()


def _refuse_lights(request: Any) -> Any:
    raise ValueError(
        f"light '{request.light_name}': lights are not supported; this simulation renders with its own light, "
        "and lights of world files have no effect"
    )
