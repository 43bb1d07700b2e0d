# SPDX-License-Identifier: BSD-3-Clause
"""A state that opens, closes or holds the manipulator according to a grasp message."""

from __future__ import annotations

from typing import Any, Unpack

import rospy

from modular_framework_core.grasp_generation.object_names import is_named
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_ros.calls import CallError
from modular_framework_states.grasp_goals import GraspGoalError, Stage, send
from modular_framework_states.held_objects import held_objects
from modular_framework_states.manager_clients import ManagerError, selected_or_named

SIMULATION_PARAMETER = "simulation"
SCENE_PERIOD_S, SCENE_TIMEOUT_S = 0.1, 2.0
"""Period of the planning scene requests, and maximum delay until the simulation attaches a held object [s]."""


class Grasp(FrameworkState):
    """Sends one stage of a grasp to the manipulator; positive only if the server reports that the stage was reached.

    Args:
        grasp_type: Stage of the grasp: pregrasp, grasp or postgrasp.
        grasp_name: Name of the grasp; empty for the oldest anonymous grasp. The input key ``selected_grasp`` replaces
            it.
        timeout: Maximum wait for the end of the motion [s].
        verify_held: Whether to require, in simulation, that the object is attached to the manipulator in the planning
            scene, since the fingers may have stopped for another reason, such as contact with each other.
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("manipulator_controller_client", "max_torque")

    def __init__(
        self,
        grasp_type: Stage,
        grasp_name: str = "",
        timeout: Positive = 60.0,
        verify_held: bool = False,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._type, self._name, self._timeout_s = grasp_type, grasp_name, float(timeout)
        self._verify_held = verify_held

    def execute(self, userdata: Any) -> str:
        """Sends the goal and waits for its end."""
        try:
            grasp = selected_or_named(self, userdata, "grasp", self._name)
            client, max_torque = userdata.manipulator_controller_client, userdata.max_torque
            send(
                client,
                self._type,
                grasp,
                max_torque=max_torque,
                timeout_s=self._timeout_s,
                stop_requested=self.preempt_requested,
            )
            if self._verify_held and rospy.get_param(SIMULATION_PARAMETER, False) and not self._holds(grasp.object_id):
                what = f"'{grasp.object_id}'" if grasp.object_id else "an object"
                return self.fail(
                    f"the fingers stopped, but the simulation sees no two of them press on {what}; they stopped on "
                    "something else"
                )
        except (ManagerError, GraspGoalError, CallError) as error:
            return self.fail(f"{self._type} of grasp '{self._name or 'selected'}' was not reached: {error}")
        return self.succeed()

    def _holds(self, name: str) -> bool:
        """Waits until the planning scene has an object attached to the manipulator; any object if no name is given."""

        def is_attached() -> bool:
            return any(is_named(held, name) for held in held_objects())

        return self.wait_until(is_attached, SCENE_TIMEOUT_S, SCENE_PERIOD_S)
