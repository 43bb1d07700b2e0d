# SPDX-License-Identifier: BSD-3-Clause
"""Calls the simulation's services for the buttons of the control panel."""

from __future__ import annotations

from typing import Any

import rospy
from gazebo_msgs.srv import (
    GetPhysicsProperties,
    GetPhysicsPropertiesRequest,
    SetPhysicsProperties,
    SetPhysicsPropertiesRequest,
)
from simulation_time_msgs.srv import AdvanceTime, AdvanceTimeRequest
from std_srvs.srv import Empty, EmptyRequest

from modular_framework_ros.calls import CallError, call_service, wait_for_service
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.viewer.control_panel import CommandError

_TIMEOUT_S = 5.0
_RESET_TIMEOUT_S = 30.0


class GazeboCommands:
    """Calls /gazebo/{pause,unpause}_physics, step_time, reset_{world,simulation} and {get,set}_physics_properties."""

    def pause(self) -> None:
        """Pauses time."""
        _call(ros_names.PAUSE_PHYSICS, Empty, EmptyRequest())

    def unpause(self) -> None:
        """Unpauses time."""
        _call(ros_names.UNPAUSE_PHYSICS, Empty, EmptyRequest())

    def step(self, duration_s: float) -> None:
        """Pauses time and advances by a duration [s]; 0 for one physics step."""
        self.pause()
        duration = rospy.Duration.from_sec(duration_s)
        response = _call(ros_names.STEP_TIME, AdvanceTime, AdvanceTimeRequest(duration), _RESET_TIMEOUT_S)
        if not response.success:
            raise CommandError(f"{ros_names.STEP_TIME}: {response.message}")

    def reset_world(self) -> None:
        """Resets the models and the robot to their initial poses."""
        _call(ros_names.RESET_WORLD, Empty, EmptyRequest(), _RESET_TIMEOUT_S)

    def reset_simulation(self) -> None:
        """Resets the models and the robot to their initial poses, and time to 0."""
        _call(ros_names.RESET_SIMULATION, Empty, EmptyRequest(), _RESET_TIMEOUT_S)

    def set_real_time_factor(self, factor: float) -> None:
        """Sets the maximum ratio of simulated to real time; 0 for as fast as possible."""
        current = self._physics()
        request = SetPhysicsPropertiesRequest(
            time_step=current.time_step,
            max_update_rate=factor / current.time_step,
            gravity=current.gravity,
            ode_config=current.ode_config,
        )
        response = _call(ros_names.SET_PHYSICS_PROPERTIES, SetPhysicsProperties, request)
        if not response.success:
            raise CommandError(response.status_message)

    def real_time_factor(self) -> float:
        """Returns the maximum ratio of simulated to real time, rounded to four digits."""
        current = self._physics()
        return float(f"{current.max_update_rate * current.time_step:.4g}")

    def _physics(self) -> Any:
        return _call(ros_names.GET_PHYSICS_PROPERTIES, GetPhysicsProperties, GetPhysicsPropertiesRequest())


def _call(name: str, kind: Any, request: Any, timeout_s: float = _TIMEOUT_S) -> Any:
    """Calls a service; the end of the node ends the call.

    Args:
        name: Name of the service.
        kind: Type of the service.
        request: Request of the call.
        timeout_s: Timeout of the response [s].

    Raises:
        CommandError: The simulation is not running or did not respond.
    """
    try:
        proxy = rospy.ServiceProxy(name, kind)
        wait_for_service(proxy, timeout_s)
        return call_service(proxy, request, timeout_s, rospy.is_shutdown)
    except CallError as error:
        raise CommandError(str(error)) from None
