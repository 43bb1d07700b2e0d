# SPDX-License-Identifier: BSD-3-Clause
"""A state that releases the objects held by the manipulator."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

import rospy

from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import NotNegative, Positive
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_states.grasp_goals import GraspGoalError, send
from modular_framework_states.held_objects import detach, have_moved, held_objects, object_poses
from modular_framework_states.manipulator_postures import posture_grasp, posture_positions

SIMULATION_PARAMETER = "simulation"
SCENE_PERIOD_S = 0.1


class Release(FrameworkState):
    """Opens the manipulator wide; positive once the fingers are open and no object is attached to them.

    The simulation detaches an object in the planning scene when the fingers have left the object, and the state waits
    for this change. Without a simulation, the state detaches the object. With a rest time, the released objects must
    also come to rest.

    Args:
        posture: Name of the widest posture, a state of the manipulator's planning group.
        timeout: Maximum wait for the end of the motion, then for the simulation to detach the object, and then for the
            object to come to rest [s].
        rest_time: Time for which the planning scene must show the released objects at rest [s]; 0 for no check.
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("manipulator_controller_client", "max_torque")

    def __init__(
        self,
        posture: Annotated[str, Named("posture")] = "open",
        timeout: Positive = 30.0,
        rest_time: NotNegative = 0.0,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._posture, self._timeout_s, self._rest_s = posture, float(timeout), float(rest_time)
        self._time = SimulatedTime()

    def execute(self, userdata: Any) -> str:
        """Opens the fingers and detaches the held objects."""
        try:
            grasp = posture_grasp(posture_positions(self._posture), 1.0)
            client, max_torque = userdata.manipulator_controller_client, userdata.max_torque
            released = list(held_objects()) if self._rest_s else []
            send(
                client,
                "pregrasp",
                grasp,
                max_torque=max_torque,
                timeout_s=self._timeout_s,
                stop_requested=self.preempt_requested,
            )
            if rospy.get_param(SIMULATION_PARAMETER, False):
                self.wait_until(self._nothing_held, self._timeout_s, SCENE_PERIOD_S)
            elif held := held_objects():
                detach(held)
            if self.preempt_requested():
                return self.stopped()
            remaining = held_objects()
            rests = bool(remaining) or self._wait_for_rest(released)
        except (RobotModelError, GraspGoalError, CallError) as error:
            return self.fail(f"release by the posture '{self._posture}': {error}")
        if remaining:
            return self.fail(
                f"the fingers are open ('{self._posture}'), but the planning scene still has "
                f"{', '.join(remaining)} attached to {', '.join(sorted(set(remaining.values())))} after "
                f"{self._timeout_s:g} s; check why the fingers still hold it"
            )
        if not rests:
            return self.fail(
                f"the fingers released {', '.join(released)}, but the planning scene does not show it at rest for "
                f"{self._rest_s:g} s within {self._timeout_s:g} s"
            )
        return self.succeed()

    def _pass_time(self) -> None:
        """Advances held simulated time, so that the simulation detects a release and the object comes to rest."""
        if self._time.enabled:
            self._time.sleep(SCENE_PERIOD_S)

    def _nothing_held(self) -> bool:
        if not held_objects():
            return True
        self._pass_time()
        return False

    def _wait_for_rest(self, objects: list[str]) -> bool:
        """Waits until objects are at rest for the rest time; returns whether they are."""
        if not objects:
            return True
        poses, since_s = object_poses(objects), rospy.get_time()

        def is_at_rest() -> bool:
            nonlocal poses, since_s
            self._pass_time()
            current = object_poses(objects)
            if have_moved(poses, current):
                poses, since_s = current, rospy.get_time()
            return rospy.get_time() - since_s >= self._rest_s

        return self.wait_until(is_at_rest, self._timeout_s, SCENE_PERIOD_S)
