# SPDX-License-Identifier: BSD-3-Clause
"""A state that releases the objects held by the manipulator."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

import rospy

from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError, wait_until
from modular_framework_states.grasp_goals import GraspGoalError, send
from modular_framework_states.held_objects import detach, held_objects
from modular_framework_states.manipulator_postures import posture_grasp, posture_positions

SIMULATION_PARAMETER = "simulation"
SCENE_PERIOD_S = 0.1


class Release(FrameworkState):
    """Opens the manipulator wide; positive once the fingers are open and no object is attached to them.

    The simulation detaches an object in the planning scene when the fingers have left it, and the state waits for that.
    Without a simulation, the state detaches the object.

    Args:
        posture: Name of the widest posture, a state of the manipulator's planning group.
        timeout: Maximum wait for the end of the motion, and then for the simulation to detach the object [s].
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("manipulator_controller_client", "max_torque")

    def __init__(
        self, posture: Annotated[str, Named("posture")] = "open", timeout: Positive = 30.0, **keys: Unpack[StateKeys]
    ) -> None:
        super().__init__(**keys)
        self._posture, self._timeout_s = posture, float(timeout)

    def execute(self, userdata: Any) -> str:
        """Opens the fingers and detaches the held objects."""
        try:
            grasp = posture_grasp(posture_positions(self._posture), 1.0)
            client, max_torque = userdata.manipulator_controller_client, userdata.max_torque
            send(
                client,
                "pregrasp",
                grasp,
                max_torque=max_torque,
                timeout_s=self._timeout_s,
                stop_requested=self.preempt_requested,
            )
            if rospy.get_param(SIMULATION_PARAMETER, False):
                wait_until(lambda: self.preempt_requested() or not held_objects(), self._timeout_s, SCENE_PERIOD_S)
            elif held := held_objects():
                detach(held)
            if self.preempt_requested():
                return self.stopped()
            remaining = held_objects()
        except (RobotModelError, GraspGoalError, CallError) as error:
            return self.fail(f"release by the posture '{self._posture}': {error}")
        if remaining:
            return self.fail(
                f"the fingers are open ('{self._posture}'), but the planning scene still has "
                f"{', '.join(remaining)} attached to {', '.join(sorted(set(remaining.values())))} after "
                f"{self._timeout_s:g} s; check why the fingers still hold it"
            )
        return self.succeed()
