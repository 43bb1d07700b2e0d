# SPDX-License-Identifier: BSD-3-Clause
"""The buttons' services of the simulation."""

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

from modular_framework_ros.calls import CallError, request_service
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.viewer.control_panel import CommandError

_TIMEOUT_S = 5.0
_RESET_TIMEOUT_S = 30.0


class GazeboCommands:
    """Calls /gazebo/{pause,unpause}_physics, step_time, reset_{world,simulation} and {get,set}_physics_properties."""

    def pause(self) -> None:
        """Stops time."""
        _call(ros_names.PAUSE_PHYSICS, Empty, EmptyRequest())

    def unpause(self) -> None:
        """Resumes time."""
        _call(ros_names.UNPAUSE_PHYSICS, Empty, EmptyRequest())

    def step(self, duration_s: float) -> None:
        """Stops time and lets a duration pass [s]; 0 is one physics step."""
        self.pause()
        duration = rospy.Duration.from_sec(duration_s)
        answer = _call(ros_names.STEP_TIME, AdvanceTime, AdvanceTimeRequest(duration), _RESET_TIMEOUT_S)
        if not answer.success:
            raise CommandError(f"{ros_names.STEP_TIME}: {answer.message}")

    def reset_world(self) -> None:
        """Puts models and robot where they started."""
        _call(ros_names.RESET_WORLD, Empty, EmptyRequest(), _RESET_TIMEOUT_S)

    def reset_simulation(self) -> None:
        """Puts models and robot where they started, and time to 0."""
        _call(ros_names.RESET_SIMULATION, Empty, EmptyRequest(), _RESET_TIMEOUT_S)

    def set_real_time_factor(self, factor: float) -> None:
        """Bounds simulated over real time; 0: as fast as possible."""
        present = self._physics()
        request = SetPhysicsPropertiesRequest(
            time_step=present.time_step,
            max_update_rate=factor / present.time_step,
            gravity=present.gravity,
            ode_config=present.ode_config,
        )
        answer = _call(ros_names.SET_PHYSICS_PROPERTIES, SetPhysicsProperties, request)
        if not answer.success:
            raise CommandError(answer.status_message)

    def real_time_factor(self) -> float:
        """Returns that bound, to four digits."""
        present = self._physics()
        return float(f"{present.max_update_rate * present.time_step:.4g}")

    def _physics(self) -> Any:
        return _call(ros_names.GET_PHYSICS_PROPERTIES, GetPhysicsProperties, GetPhysicsPropertiesRequest())


def _call(name: str, kind: Any, request: Any, timeout_s: float = _TIMEOUT_S) -> Any:
    """Calls a service.

    Raises:
        CommandError: There is no simulation, or it did not answer.
    """
    try:
        return request_service(name, kind, request, timeout_s)
    except CallError as error:
        raise CommandError(str(error)) from None
