# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task open, close or keep the manipulator as a grasp message says."""

from __future__ import annotations

from typing import Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_states.grasp_goals import GraspGoalError, Stage, send
from modular_framework_states.manager_clients import ManagerError, selected_or_named


class Grasp(FrameworkState):
    """Sends one stage of a grasp to the manipulator; positive only when the server says that stage was reached.

    Args:
        grasp_type: Pregrasp, grasp or postgrasp.
        grasp_name: Name of the grasp; empty takes the oldest anonymous one. Userdata ``selected_grasp`` is taken
            instead when it is an input key.
        timeout: Longest wait for the end of the motion [s].
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("manipulator_controller_client", "max_torque")

    def __init__(
        self, grasp_type: Stage, grasp_name: str = "", timeout: Positive = 60.0, **keys: Unpack[StateKeys]
    ) -> None:
        super().__init__(**keys)
        self._type, self._name, self._timeout_s = grasp_type, grasp_name, float(timeout)

    def execute(self, userdata: Any) -> str:
        """Sends the goal and waits for its end."""
        try:
            grasp = selected_or_named(self, userdata, "grasp", self._name)
            client, max_torque = userdata.manipulator_controller_client, userdata.max_torque
            send(client, self._type, grasp, max_torque, self._timeout_s, self.preempt_requested)
        except (ManagerError, GraspGoalError) as error:
            return self.fail(f"{self._type} of grasp '{self._name or 'selected'}' was not reached: {error}")
        return self.succeed()
