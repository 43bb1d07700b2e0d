# SPDX-License-Identifier: BSD-3-Clause
"""A state that opens or closes the manipulator without a grasp message."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Unpack

from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Finite, Positive, Share
from modular_framework_core.state_api.option_uses import Named
from modular_framework_states.grasp_goals import GraspGoalError, Stage, send
from modular_framework_states.manipulator_postures import posture_grasp, posture_positions


class Gripper(FrameworkState):
    """Moves the fingers to a posture; positive if they reach it or, with ``grip``, if they hold an object.

    Args:
        posture: Name of a state of the manipulator's planning group, such as open or closed.
        positions: Joint to position [rad or m], instead of a posture.
        grip: Whether to close on an object: positive if an object stops the fingers before they are closed.
        torque: Fraction of the maximum torque.
        timeout: Maximum wait for the end of the motion [s].
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("manipulator_controller_client", "max_torque")

    def __init__(
        self,
        posture: Annotated[str, Named("posture")] = "",
        positions: Mapping[str, Finite] | None = None,
        grip: bool = False,
        torque: Share = 1.0,
        timeout: Positive = 30.0,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        if bool(posture) == bool(positions):
            raise ValueError("Gripper: give either posture or positions")
        self._posture, self._positions = posture, dict(positions or {})
        self._stage: Stage = "grasp" if grip else "pregrasp"
        self._torque, self._timeout_s = float(torque), float(timeout)

    def execute(self, userdata: Any) -> str:
        """Moves the fingers."""
        target = self._posture or ", ".join(f"{joint} {position}" for joint, position in self._positions.items())
        try:
            positions = self._positions or posture_positions(self._posture)
            grasp = posture_grasp(positions, self._torque)
            client, max_torque = userdata.manipulator_controller_client, userdata.max_torque
            send(
                client,
                self._stage,
                grasp,
                max_torque=max_torque,
                timeout_s=self._timeout_s,
                stop_requested=self.preempt_requested,
            )
        except (RobotModelError, GraspGoalError) as error:
            return self.fail(f"gripper to {target}: {error}")
        return self.succeed()
