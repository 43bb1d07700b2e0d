# SPDX-License-Identifier: BSD-3-Clause
"""The services and topics with which Gazebo is asked, answered by the simulated world."""

from __future__ import annotations

from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.gazebo_ros.joint_services import JointServices
from modular_framework_simulation.gazebo_ros.light_services import LightServices
from modular_framework_simulation.gazebo_ros.link_services import LinkServices
from modular_framework_simulation.gazebo_ros.model_services import ModelServices
from modular_framework_simulation.gazebo_ros.physics_services import PhysicsServices
from modular_framework_simulation.loop.simulation_loop import SimulationLoop
from modular_framework_simulation.models.sdf_resources import Resources


class GazeboServices:
    """Advertises and answers everything below /gazebo that gazebo_ros has.

    See `ModelServices`, `LinkServices`, `JointServices`, `PhysicsServices` and `LightServices`.

    Args:
        loop: The simulation loop.
        resources: Where spawned models find what they refer to.
    """

    def __init__(self, loop: SimulationLoop, resources: Resources) -> None:
        self._endpoints = Endpoints(loop)
        self._physics = PhysicsServices(loop)
        self._groups = (
            ModelServices(loop, resources),
            LinkServices(loop.world),
            JointServices(loop.world),
            LightServices(),
            self._physics,
        )

    def connect(self) -> None:
        """Opens everything."""
        for group in self._groups:
            group.connect(self._endpoints)

    def refresh(self) -> None:
        """Publishes the settings of the physics, after the world has begun again with those of the start."""
        self._physics.refresh()

    def close(self) -> None:
        """Closes everything; may be called twice."""
        self._physics.close()
        self._endpoints.close()
