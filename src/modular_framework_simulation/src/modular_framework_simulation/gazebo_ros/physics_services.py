# SPDX-License-Identifier: BSD-3-Clause
"""Services for the whole world: physics settings, time and resets."""

from __future__ import annotations

from typing import Any

import rospy
from gazebo_msgs import srv
from std_srvs.srv import Empty

from modular_framework_ros.reconfiguration import Reconfiguration
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.gazebo_ros.adjustable_physics import (
    TABLE,
    AdjustablePhysics,
    PhysicsValues,
    gravity_to_msg,
    ode_to_msg,
    values_from_request,
)
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.loop.simulation_loop import SimulationLoop


class PhysicsServices:
    """Serves /gazebo/{get,set}_physics_properties, get_world_properties, {pause,unpause}_physics and reset_*.

    Serves dynamic_reconfigure in /gazebo: set_parameters, parameter_descriptions and parameter_updates.

    Args:
        loop: Loop with the world and the pacer.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self._loop = loop
        self._physics = AdjustablePhysics(loop)
        self._endpoints = Endpoints(loop)
        self._reconfiguration = Reconfiguration(ros_names.NAMESPACE, TABLE, self, "values")

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the services."""
        self._endpoints = endpoints
        endpoints.serve(ros_names.GET_PHYSICS_PROPERTIES, srv.GetPhysicsProperties, self._get_properties)
        endpoints.serve_outside_loop(ros_names.SET_PHYSICS_PROPERTIES, srv.SetPhysicsProperties, self._set_properties)
        endpoints.serve(ros_names.GET_WORLD_PROPERTIES, srv.GetWorldProperties, self._get_world)
        endpoints.command(ros_names.PAUSE_PHYSICS, Empty, lambda _request: self._loop.pause())
        endpoints.command(ros_names.UNPAUSE_PHYSICS, Empty, lambda _request: self._loop.unpause())
        endpoints.command(ros_names.RESET_SIMULATION, Empty, lambda _request: self._loop.reset_all())
        endpoints.command(ros_names.RESET_WORLD, Empty, lambda _request: self._loop.reset_poses())
        self._reconfiguration.connect()

    def refresh(self) -> None:
        """Makes dynamic_reconfigure publish the current settings after a change by another service."""
        self._reconfiguration.refresh()

    def close(self) -> None:
        """Closes dynamic_reconfigure; may be called twice."""
        self._reconfiguration.close()

    @property
    def values(self) -> PhysicsValues:
        """Returns the settings for dynamic_reconfigure; the setter applies new settings."""
        values: PhysicsValues = self._endpoints.in_loop(ros_names.SET_PARAMETERS, self._physics.current)
        return values

    @values.setter
    def values(self, values: PhysicsValues) -> None:
        try:
            self._endpoints.in_loop(ros_names.SET_PARAMETERS, lambda: self._physics.apply(values))
            self._loop.referee.note(ros_names.SET_PARAMETERS, self._reconfiguration.caller)
        except ValueError as error:
            raise rospy.ServiceException(f"{ros_names.SET_PARAMETERS}: {error}") from None

    def _get_properties(self, _request: Any) -> Any:
        values = self._physics.current()
        response = srv.GetPhysicsPropertiesResponse(success=True, status_message="read the properties of the physics")
        response.time_step, response.max_update_rate = values.time_step, values.max_update_rate
        response.pause = self._loop.paused
        response.gravity, response.ode_config = gravity_to_msg(values), ode_to_msg(values)
        return response

    def _set_properties(self, request: Any) -> Any:
        values = values_from_request(request)
        ignored = self._endpoints.in_loop(ros_names.SET_PHYSICS_PROPERTIES, lambda: self._physics.apply(values))
        self._reconfiguration.refresh()
        text = "set the properties of the physics"
        if ignored:
            text += f"; without effect, because this engine does not support them: {', '.join(ignored)}"
            rospy.logwarn("%s: %s", ros_names.SET_PHYSICS_PROPERTIES, text)
        return srv.SetPhysicsPropertiesResponse(True, text)

    def _get_world(self, _request: Any) -> Any:
        world = self._loop.world
        return srv.GetWorldPropertiesResponse(
            sim_time=world.time_ns * 1e-9,
            model_names=world.names(),
            rendering_enabled=world.engine.has_window,
            success=True,
            status_message="read the properties of the world",
        )
