# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task open, close or keep the manipulator as a grasp message says."""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from modular_framework_core.framework_state import FrameworkState
from modular_framework_core.msg import GraspCommand, GraspGoal
from modular_framework_core.ros_calls import CallError, wait_for_action, wait_for_result
from modular_framework_states.manager_clients import ManagerError, fetch

GRASP_STATES = {"pregrasp": GraspCommand.PRE_GRASP_STATE, "grasp": GraspCommand.GRASP_STATE,
                "postgrasp": GraspCommand.POST_GRASP_STATE}
RESULT_FLAGS = {"pregrasp": "pregrasped", "grasp": "grasped", "postgrasp": "postgrasped"}
SERVER_TIMEOUT_S = 10.0
SUCCEEDED = 3


class Grasp(FrameworkState):
    """Sends one stage of a grasp to the manipulator; positive only when the server says that stage was reached.

    Args:
        grasp_type: pregrasp, grasp or postgrasp.
        grasp_name: Name of the grasp; empty takes the oldest anonymous one. Userdata ``selected_grasp`` is taken
            instead when it is an input key.
        timeout: Longest wait for the end of the motion [s].
        outcomes: First positive, last negative.
        input_keys: Userdata that is read.
        output_keys: Userdata that is written.
        io_keys: Userdata that is read and written; must hold ``manipulator_controller_client`` and ``max_torque``.
    """

    def __init__(self, grasp_type: Literal["pregrasp", "grasp", "postgrasp"], grasp_name: str = "",
                 timeout: float = 60.0, outcomes: Sequence[str] = ("success", "fail"), input_keys: Sequence[str] = (),
                 output_keys: Sequence[str] = (),
                 io_keys: Sequence[str] = ("manipulator_controller_client", "max_torque")) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        if grasp_type not in GRASP_STATES:
            raise ValueError(f"Grasp: grasp_type is '{grasp_type}', allowed are {list(GRASP_STATES)}")
        self._type, self._name, self._timeout_s = grasp_type, grasp_name, float(timeout)

    def execute(self, userdata: Any) -> str:
        """Sends the goal and waits for its end."""
        client = userdata.manipulator_controller_client
        if client is None:
            return self.fail(f"{self._type}: the task has no manipulator; set manipulator_prefix to drive one")
        try:
            grasp = self._grasp(userdata)
            wait_for_action(client, "the manipulator's action server", SERVER_TIMEOUT_S)
        except (ManagerError, CallError) as error:
            return self.fail(f"{self._type}: {error}")
        command = GraspCommand(grasp_state=GRASP_STATES[self._type], grasp=grasp, max_torque=float(userdata.max_torque))
        client.send_goal(GraspGoal(grasp_command=command))
        status = wait_for_result(client, self._timeout_s, self.preempt_requested)
        if self.preempt_requested():
            return self.stopped()
        result = client.get_result()
        if status == SUCCEEDED and result is not None and getattr(result, RESULT_FLAGS[self._type]).data:
            return self.succeed()
        text = client.get_goal_status_text() or f"the server answered status {status} and no reason"
        return self.fail(f"{self._type} of grasp '{grasp.grasp_id}' was not reached: {text}")

    def _grasp(self, userdata: Any) -> Any:
        if "selected_grasp" not in self.get_registered_input_keys():
            return fetch("grasp", self._name)
        if userdata.selected_grasp is None:
            raise ManagerError("userdata 'selected_grasp' is empty; select a grasp first")
        return userdata.selected_grasp
