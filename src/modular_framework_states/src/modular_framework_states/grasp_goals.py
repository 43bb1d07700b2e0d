# SPDX-License-Identifier: BSD-3-Clause
"""Sends grasp stages to the manipulator's action server and evaluates the results, for the states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from modular_framework_core.msg import GraspCommand, GraspGoal
from modular_framework_ros.calls import CallError, wait_for_action, wait_for_result

Stage = Literal["pregrasp", "grasp", "postgrasp"]
SERVER_TIMEOUT_S = 10.0
SUCCEEDED = 3
_NUMBERS = {
    "pregrasp": GraspCommand.PRE_GRASP_STATE,
    "grasp": GraspCommand.GRASP_STATE,
    "postgrasp": GraspCommand.POST_GRASP_STATE,
}
_RESULT_FLAGS = {"pregrasp": "pregrasped", "grasp": "grasped", "postgrasp": "postgrasped"}


class GraspGoalError(RuntimeError):
    """A stage was not reached; the message gives the reason."""


def send(
    client: Any, stage: Stage, grasp: Any, *, max_torque: float, timeout_s: float, stop_requested: Callable[[], bool]
) -> None:
    """Sends a grasp stage and returns once the server reports that the stage was reached.

    Args:
        client: Client of the manipulator's action server; None if the task has no manipulator.
        stage: Stage of the grasp.
        grasp: Grasp message.
        max_torque: Fraction of the maximum torque.
        timeout_s: Maximum wait for the end [s].
        stop_requested: Function polled during the wait; the goal is cancelled when it returns True.

    Raises:
        GraspGoalError: The task has no manipulator or server, the stage was not reached, or a stop was requested.
    """
    start_stage(client, stage, grasp, max_torque)
    status = wait_for_result(client, timeout_s, stop_requested)
    result = client.get_result()
    if status == SUCCEEDED and result is not None and getattr(result, _RESULT_FLAGS[stage]).data:
        return
    raise GraspGoalError(client.get_goal_status_text() or f"the server returned status {status} without a reason")


def start_stage(client: Any, stage: Stage, grasp: Any, max_torque: float) -> None:
    """Sends a grasp stage without waiting for its end.

    Args:
        client: Client of the manipulator's action server; None if the task has no manipulator.
        stage: Stage of the grasp.
        grasp: Grasp message.
        max_torque: Fraction of the maximum torque.

    Raises:
        GraspGoalError: The task has no manipulator or server.
    """
    if client is None:
        raise GraspGoalError("the task has no manipulator; set manipulator_prefix to drive one")
    try:
        wait_for_action(client, "the manipulator's action server", SERVER_TIMEOUT_S)
    except CallError as error:
        raise GraspGoalError(str(error)) from error
    command = GraspCommand(grasp_state=_NUMBERS[stage], grasp=grasp, max_torque=float(max_torque))
    client.send_goal(GraspGoal(grasp_command=command))
